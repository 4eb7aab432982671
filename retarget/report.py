"""The report of `retarget`: the motion's gait parameters, measures, reliability and warnings (gait.json)."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.angles import ANGLES
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.retarget.cyclic import CyclicFit
from kinemimic.retarget.feet.ground import is_running
from kinemimic.retarget.feet.scale import estimate_subject
from kinemimic.retarget.formats.gait_json import GAIT_SCHEMA
from kinemimic.retarget.gate import check_report
from kinemimic.retarget.humanoid.motion import Motion, joint_angles
from kinemimic.retarget.measure import Measures, measure
from kinemimic.retarget.noncyclic import NonCyclicFit
from kinemimic.retarget.strides.passes import Pass, brevity_note


def cyclic_report(
    clip: Clip, passes: list[Pass], closed: CyclicFit, fit: CyclicFit, warnings: list[str]
) -> dict[str, Any]:
    """The value of gait.json for a gait loop; lengths in metres, angles in degrees.

    closed, fit: before and after refinement.
    """
    motion, path = fit.motion, fit.path
    strides = sum(_strides(p) for p in _used(passes, fit))
    gait = "run" if is_running(path.speed) else "walk"
    ranges = {name: _range(curve) for name, curve in joint_angles(motion.rotations).items()}
    cadence = 120.0 / motion.duration
    report = {
        "schema": GAIT_SCHEMA,
        "kind": gait,
        "simulated_capture": clip.simulated,
        "cyclic": True,
        "period_s": _n(motion.duration),
        "cadence_steps_per_min": _n(cadence),
        "speed_m_s": _n(path.speed),
        "speed_capture_m_s": _n(fit.loop.speed),
        "stride_m": _n(path.speed * motion.duration),
        "stance_ratio": _stance(motion),
        "range_deg": ranges,
        "strides": _n(strides),
        "frames_used": len(fit.strides.phase),
        "r2_loop_against_capture": _r2(fit),
        "passes": [_pass_row(p, clip, fit) for p in passes],
        "symmetric": fit.symmetric,
        "asymmetry_deg": _n(fit.asymmetry_deg),
        "noise_deg": _n(fit.noise_deg),
        "reliability": {
            "precise": fit.reliability.precise,
            "pelvis": fit.reliability.pelvis,
            "torso": fit.reliability.torso,
            "feet": fit.reliability.feet,
            **{name: _n(value) for name, value in fit.reliability.measured.items()},
        },
        "subject": _subject(fit.strides.positions),
        "scale": _n(fit.scale),
        "stance_width_m": _n(fit.width),
        "abduction_deg": _n(np.degrees(fit.abduction)),
        "ground": {
            "height_shift_m": _n(path.shift),
            "follows_foot": path.follows,
            "penetration_m": _n(path.penetration),
            "floating_m": _n(path.floating),
            "swing_clearance_m": _n(path.clearance),
            "slip_m_s": _n(path.slip),
            "slip_recorded_m_s": _n(path.slip_recorded),
        },
        **{
            name: {
                **_measures(measure(one.motion, one.strides.positions, one.strides.phase)),
                "r2_against_capture": _r2(one),
            }
            for name, one in (("closed_form", closed), ("measures", fit))
        },
    }
    return _with_findings(report, warnings)


def noncyclic_report(clip: Clip, fit: NonCyclicFit, motion: Motion, one: Pass) -> dict[str, Any]:
    """The value of gait.json for a pass as recorded, from its closed form `fit` and final motion."""
    kind, walk = "motion", {}
    if fit.strides is not None:
        speed = float(np.linalg.norm(motion.root[-1, :2] - motion.root[0, :2])) / motion.duration
        kind = "run" if is_running(speed) else "walk"
        walk = {
            "period_s": _n(motion.duration / fit.strides),
            "cadence_steps_per_min": _n(120.0 * fit.strides / motion.duration),
            "speed_m_s": _n(speed),
            "strides": _n(fit.strides),
        }
    report = {
        "schema": GAIT_SCHEMA,
        "kind": kind,
        "simulated_capture": clip.simulated,
        "cyclic": False,
        "duration_s": _n(motion.duration),
        **walk,
        "frames_used": len(fit.frames),
        "range_deg": {name: _range(curve) for name, curve in joint_angles(motion.rotations).items()},
        "pass": one.number,
        "stance_ratio": _stance(motion),
        "subject": _subject(fit.positions),
        "scale": _n(fit.scale),
        **{
            name: _measures(measure(each, fit.positions, fit.phase))
            for name, each in (("closed_form", fit.motion), ("measures", motion))
        },
    }
    why = brevity_note(one) or "nobody walks in this capture"
    warning = f"{why}: the longest pass is kept as recorded, without a loop"
    return _with_findings(report, [] if walk else [warning])


def _with_findings(report: dict[str, Any], warnings: list[str]) -> dict[str, Any]:
    """The report with the findings of the gate before training, which also join the warnings."""
    found = check_report(report)
    return {
        **report,
        "gate": [asdict(finding) for finding in found],
        "warnings": [*warnings, *(finding.message for finding in found)],
    }


def r_squared(captured: Array, fitted: Array) -> float:
    """Coefficient of determination R² of fitted (M,) against captured (M,); NaN without variance.

    Frames in which either is NaN are left out.
    """
    seen = np.isfinite(captured) & np.isfinite(fitted)
    if seen.sum() < 2:
        return float("nan")
    x, y = captured[seen], fitted[seen]
    spread = float(np.sum((x - x.mean()) ** 2))
    return 1.0 - float(np.sum((x - y) ** 2)) / spread if spread > 0 else float("nan")


def reference_at(motion: Motion, phase: Array) -> dict[str, Array]:
    """The motion's knee and hip angles (M,) in radians at phases (M,)."""
    curves = joint_angles(motion.rotations)
    frames = len(motion.root)
    knots = np.arange(frames + 1) / frames if motion.cyclic else np.arange(frames) / (frames - 1)
    at = np.mod(phase, 1.0) if motion.cyclic else phase
    return {
        name: np.interp(at, knots, np.append(curve, curve[0]) if motion.cyclic else curve)
        for name, curve in curves.items()
    }


def _strides(one: Pass) -> float:
    return float(np.ptp(one.phase)) if one.harmonic else 0.0


def _used(passes: list[Pass], fit: CyclicFit) -> list[Pass]:
    frames = set(fit.strides.frames.tolist())
    return [p for p in passes if p.harmonic is not None and len(p.frames) and int(p.frames[0]) in frames]


def _r2(fit: CyclicFit, mask: NDArray[np.bool_] | None = None) -> dict[str, float | None]:
    pick = np.ones(len(fit.strides.phase), bool) if mask is None else mask
    fitted = reference_at(fit.motion, fit.strides.phase[pick])
    scores: dict[str, float | None] = {}
    for name in ANGLES:
        scores[name] = _n(r_squared(fit.captured[name][pick], fitted[name]))
    return scores


def _pass_row(one: Pass, clip: Clip, fit: CyclicFit) -> dict[str, Any]:
    mine = clip.passes[fit.strides.frames] == one.number
    used = bool(mine.any())
    h = one.harmonic
    row: dict[str, Any] = {
        "pass": one.number,
        "verdict": one.verdict,
        "used": used,
        "reason": one.reason,
        "frames": int((clip.passes == one.number).sum()),
        "frames_kept": len(one.frames),
        "frames_bad": int(one.bad.sum()),
        "heading_deg": _n(np.degrees(one.heading)),
        "speed_m_s": _n(one.speed),
    }
    if h is not None:
        row |= {
            "harmonic_r2": _n(h.r2),
            "harmonic_kept": _n(h.kept),
            "period_s": _n(h.period),
            "ankle_amplitude_m": _n(h.amplitude),
            "drift_cycles": _n(one.drift),
            "strides_timed_individually": one.individually_timed,
        }
    if used:
        row["r2"] = _r2(fit, mine)
    return row


def _stance(motion: Motion) -> dict[str, float | None]:
    return {side: _n(motion.contacts[:, k].mean()) for k, side in enumerate(("left", "right"))}


def _subject(positions: Array) -> dict[str, float | None]:
    person = estimate_subject(positions)
    return {"height_m": _n(person.height), "mass_at_body_density_kg": _n(person.mass)}


def _measures(found: Measures) -> dict[str, Any]:
    return {
        "foot_speed_m_s": _n(found.foot_speed),
        "foot_speed_95_m_s": _n(found.foot_speed_95),
        "penetration_m": _n(found.penetration),
        "floating_m": _n(found.floating),
        "beyond_limits_deg": {joint: _n(np.degrees(angle)) for joint, angle in found.beyond.items()},
        "node_error_m": _n(found.node_error),
    }


def _range(curve: Array) -> list[float]:
    degrees = np.degrees(curve)
    return [round(float(degrees.min()), 2), round(float(degrees.max()), 2)]


def _n(value: Any) -> float | None:
    """Six significant digits, so that platforms agree; None if not finite."""
    return float(f"{float(value):.6g}") if np.isfinite(value) else None
