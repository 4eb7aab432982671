"""The report of `retarget`: the motion's gait parameters, measures, reliability and warnings (gait.json)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.gait.curve_metrics import r2
from kinemimic.pipeline.kinematics.angles import ANGLES
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.pipeline.locomotion.bouts import Bout
from kinemimic.pipeline.quality.low_rate import low_rate_note
from kinemimic.retarget.cyclic import CyclicFit
from kinemimic.retarget.feet.scale import estimate_subject
from kinemimic.retarget.feet.zero_moment_point import Balance
from kinemimic.retarget.fidelity import departure_warnings, departures
from kinemimic.retarget.formats.gait_json import GAIT_SCHEMA
from kinemimic.retarget.gate import check_report
from kinemimic.retarget.humanoid.motion import Motion, angles_at, joint_angles
from kinemimic.retarget.measure import Measures, measure
from kinemimic.retarget.motion_warnings import (
    climb_warnings,
    held_feet_warnings,
    knee_warnings,
    lean_warnings,
    side_warnings,
    width_warnings,
)
from kinemimic.retarget.noncyclic import NonCyclicFit
from kinemimic.retarget.strides.climb import Climb, climb_of
from kinemimic.retarget.strides.excerpt import Excerpt
from kinemimic.retarget.strides.selection import Selection, why_strides_are_left_out


def cyclic_report(
    clip: Clip,
    bouts: list[Bout],
    selection: Selection,
    closed: CyclicFit,
    fit: CyclicFit,
    balance: Balance | None,
) -> dict[str, Any]:
    """The value of gait.json for a gait loop; lengths in metres, angles in degrees.

    bouts: all of the capture; closed, fit: before and after refinement; balance: None if the root was not
    displaced for it.
    """
    report = {
        "schema": GAIT_SCHEMA,
        **_gait(clip, bouts, selection, fit),
        **departures(fit),
        "r2_loop_against_capture": _r2(fit),
        "bouts": [_bout_row(one, fit, selection) for one in bouts],
        **_averaging(fit),
        "subject": _subject(fit.strides.positions),
        **_on_the_ground(fit, balance),
        **{
            name: {
                **_measures(measure(one.motion, one.strides.positions, one.strides.phase)),
                "r2_against_capture": _r2(one),
            }
            for name, one in (("closed_form", closed), ("measures", fit))
        },
    }
    warnings = [*climb_warnings(report), *width_warnings(report), *side_warnings(report)]
    warnings += knee_warnings(report)
    warnings += departure_warnings(report)
    return _with_findings(report, [*warnings, *filter(None, [low_rate_note(clip.rate)])])


def _gait(clip: Clip, bouts: Sequence[Bout], selection: Selection, fit: CyclicFit) -> dict[str, Any]:
    """The gait parameters of the loop, and how much of the capture is in it."""
    motion, speed = fit.motion, fit.path.speed
    return {
        "kind": "run" if fit.path.running else "walk",
        "simulated_capture": clip.simulated,
        "cyclic": True,
        "period_s": _n(motion.duration),
        "cadence_steps_per_min": _n(120.0 / motion.duration),
        "speed_m_s": _n(speed),
        "speed_capture_m_s": _n(fit.loop.speed),
        "speed_scaled_m_s": _n(fit.scale * fit.loop.speed),
        "stride_m": _n(speed * motion.duration),
        "stance_ratio": _stance(motion),
        "range_deg": _ranges(motion),
        "strides_used": _n(selection.strides),
        "strides_found": _n(sum(one.cycles for one in bouts)),
        "strides_left_out": why_strides_are_left_out(selection.bouts),
        "frames_used": len(fit.strides.phase),
        "path": _path(selection.bouts),
        "climb": _climb(climb_of(clip, selection.bouts)),
    }


def _averaging(fit: CyclicFit) -> dict[str, Any]:
    """Whether both sides were averaged, and which of the sensor's angles were trusted."""
    reliability = fit.reliability
    return {
        "symmetric": fit.symmetric,
        "asymmetry_deg": _n(fit.asymmetry_deg),
        "noise_deg": _n(fit.noise_deg),
        "asymmetry_limit_deg": _n(fit.asymmetry_limit_deg),
        "reliability": {
            "precise": reliability.precise,
            "pelvis": reliability.pelvis,
            "torso": reliability.torso,
            "feet": reliability.feet,
            **{name: _n(value) for name, value in reliability.measured.items()},
        },
    }


def _on_the_ground(fit: CyclicFit, balance: Balance | None) -> dict[str, Any]:
    """How the loop was scaled to the humanoid, balanced and set on the ground."""
    path = fit.path
    return {
        "scale": _n(fit.scale),
        "stance_width_m": _n(fit.width),
        "stance_width_body_m": _n(fit.body_width),
        "abduction_deg": _n(np.degrees(fit.abduction)),
        "balance": _balance(balance),
        "ground": {
            "height_shift_m": _n(path.shift),
            "follows_foot": path.follows,
            "penetration_m": _n(path.penetration),
            "floating_m": _n(path.floating),
            "swing_clearance_m": _n(path.clearance),
            "slip_m_s": _n(path.slip),
            "slip_recorded_m_s": _n(path.slip_recorded),
        },
    }


def _balance(found: Balance | None) -> dict[str, Any] | None:
    """How far the zero-moment point is from the soles, and how far the root went for it; None without."""
    if found is None:
        return None
    return {
        "outside_m": _n(found.outside),
        "outside_before_m": _n(found.outside_before),
        "displacement_m": _n(found.displacement),
    }


def _climb(found: Climb) -> dict[str, Any]:
    """How far the capture climbs, which the loop does not."""
    return {
        "stride_m": _n(found.stride),
        "angle_deg": _n(np.degrees(found.angle)),
        "total_m": _n(found.total),
        "certain": found.certain,
    }


def noncyclic_report(
    clip: Clip,
    bouts: list[Bout],
    excerpt: Excerpt,
    fit: NonCyclicFit,
    motion: Motion,
    balance: Balance | None,
    why: str,
    *,
    chosen: bool = False,
) -> dict[str, Any]:
    """The value of gait.json for an excerpt as recorded, from its closed form `fit` and final motion.

    balance: None if the root was not displaced for it; why: what is missing for a loop, "" if nothing is;
    chosen: whether a segment was asked for.
    """
    walk = _walk_as_recorded(clip, excerpt, fit, motion)
    report = {
        "schema": GAIT_SCHEMA,
        "kind": "motion",  # unless `walk` has another
        "simulated_capture": clip.simulated,
        "cyclic": False,
        "duration_s": _n(motion.duration),
        **walk,
        "strides_found": _n(sum(one.cycles for one in bouts)),
        "frames_used": len(fit.frames),
        "range_deg": _ranges(motion),
        "pass": excerpt.pass_number,
        "lean_deg": _n(np.degrees(fit.lean)),
        "balance": _balance(balance),
        "stance_ratio": _stance(motion),
        "subject": _subject(fit.positions),
        "scale": _n(fit.scale),
        **{
            name: _measures(measure(each, fit.positions, fit.phase))
            for name, each in (("closed_form", fit.motion), ("measures", motion))
        },
    }
    what = "the longest bout" if walk else "the segment" if chosen else "the longest pass"
    warnings = [f"{why}: {what} is kept as recorded, without a loop"] if why else []
    warnings += [*width_warnings(report), *lean_warnings(fit.lean)]
    warnings += [*held_feet_warnings(report), *filter(None, [low_rate_note(clip.rate)])]
    return _with_findings(report, warnings)


def _walk_as_recorded(clip: Clip, excerpt: Excerpt, fit: NonCyclicFit, motion: Motion) -> dict[str, Any]:
    """Kind and gait parameters of a walk or run that is kept as recorded; empty for other motions."""
    bout, strides = excerpt.bout, fit.strides
    if bout is None or strides is None:
        return {}
    speed = _speed_ahead(motion, clip.times[excerpt.frames], excerpt.yaw, bout)
    return {
        "kind": "run" if bout.running else "walk",
        "period_s": _n(motion.duration / strides),
        "cadence_steps_per_min": _n(120.0 * strides / motion.duration),
        "speed_m_s": _n(speed),
        "speed_capture_m_s": _n(bout.speed),
        "speed_scaled_m_s": _n(abs(fit.scale * bout.speed)),
        "strides_used": _n(strides),
        "path": _path([bout]),
        "turn_deg": _n(np.degrees(excerpt.yaw[-1] - excerpt.yaw[0])),
        **_widths(fit),
    }


def _widths(fit: NonCyclicFit) -> dict[str, Any]:
    """The distance between the ankles of a walk, scaled to the body, and the body's."""
    if fit.widths is None:
        return {}
    return dict(zip(("stance_width_m", "stance_width_body_m"), map(_n, fit.widths), strict=True))


def _speed_ahead(motion: Motion, times: Array, yaw: Array, bout: Bout) -> float:
    """Speed in m/s along the heading in the strides of walking, as `Bout.speed`, without its sign.

    times: (n,) seconds of the capture's frames; yaw: (n,) radians of the heading there.
    """
    steps = np.diff(motion.root[:, :2], axis=0) * motion.rate
    at = times[0] + (np.arange(len(steps)) + 0.5) / motion.rate
    heading = np.interp(at, times, yaw)
    ahead = steps[:, 0] * np.cos(heading) + steps[:, 1] * np.sin(heading)
    spans = [stride.times for stride in bout.strides if stride.walking]
    walking = np.any([(at >= first) & (at <= last) for first, last in spans], axis=0)
    return abs(float(np.mean(ahead[walking])))


def _with_findings(report: dict[str, Any], warnings: list[str]) -> dict[str, Any]:
    """The report with the findings of the gate before training, which also join the warnings."""
    found = check_report(report)
    return {
        **report,
        "gate": [asdict(finding) for finding in found],
        "warnings": [*warnings, *(finding.message for finding in found)],
    }


def _r2(fit: CyclicFit, mask: NDArray[np.bool_] | None = None) -> dict[str, float | None]:
    pick = np.ones(len(fit.strides.phase), bool) if mask is None else mask
    fitted = angles_at(fit.motion, fit.strides.phase[pick])
    scores: dict[str, float | None] = {}
    for name in ANGLES:
        scores[name] = _n(r2(fit.captured[name][pick], fitted[name]))
    return scores


def _path(bouts: Sequence[Bout]) -> dict[str, Any]:
    """Where the speed comes from, and how far recorded path and feet disagree, in shares of a stride."""
    sources = {one.path.source for one in bouts}
    apart = [one.path.disagreement for one in bouts]
    return {"source": "feet" if "feet" in sources else "recorded", "disagreement": _n(max(apart))}


def _bout_row(one: Bout, fit: CyclicFit, selection: Selection) -> dict[str, Any]:
    used = one.number not in selection.reasons
    start, end = one.times
    row: dict[str, Any] = {
        "bout": one.number,
        "pass": one.pass_number,
        "start_s": _n(start),
        "end_s": _n(end),
        "used": used,
        "reason": selection.reasons.get(one.number, ""),
        "strides": _n(one.cycles),
        "strides_used": _n(one.used_strides),
        "left_legs_used": sum(stride.used[0] for stride in one.strides),
        "right_legs_used": sum(stride.used[1] for stride in one.strides),
        "left_out": why_strides_are_left_out([one]),
        "period_s": _n(one.period),
        "speed_m_s": _n(one.speed),
        "path": _path([one]),
        "turn_deg": _n(np.degrees(one.heading[-1] - one.heading[0])),
        "tilt_deg": _n(np.degrees(np.mean(one.tilt))),
    }
    if used:
        row["r2"] = _r2(fit, np.isin(fit.strides.frames, one.frames))
    return row


def _stance(motion: Motion) -> dict[str, float | None]:
    return {side: _n(motion.contacts[:, k].mean()) for k, side in enumerate(SIDES)}


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


def _ranges(motion: Motion) -> dict[str, list[float]]:
    """Smallest and largest knee and hip angles, in degrees."""
    curves = {name: np.degrees(curve) for name, curve in joint_angles(motion.rotations).items()}
    return {
        name: [round(float(curve.min()), 2), round(float(curve.max()), 2)] for name, curve in curves.items()
    }


def _n(value: Any) -> float | None:
    """Six significant digits, so that platforms agree; None if not finite."""
    return float(f"{float(value):.6g}") if np.isfinite(value) else None
