"""The gate before training: rules that warn of, or refuse, motions that are hard or impossible to imitate.

Each rule has two limits. Beyond the first, training succeeds with a visible flaw; beyond the second, training
failed, or the motion no longer resembles the recording. The limits come from depth-sensor walks that the
humanoid could and could not imitate, and from how people walk and run.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.retarget.formats.gait_json import GAIT, report_of_run
from kinemimic.retarget.humanoid.motion import Motion

Severity = Literal["warn", "refuse"]
Report = Mapping[str, Any]


@dataclass(frozen=True)
class Finding:
    """A rule that a motion breaks: the value and the limit that it exceeds, in the rule's unit."""

    rule: str
    severity: Severity
    value: float
    limit: float
    message: str


@dataclass(frozen=True)
class _Rule:
    """A rule of the gate.

    value: from a report, None if the rule does not apply; warn, refuse: kind of motion -> (minimum, maximum),
    infinite without a limit; digits: of the value after the point; message: a format string of `value` and
    the broken `limit`.
    """

    name: str
    value: Callable[[Report], float | None]
    warn: Mapping[str, tuple[float, float]]
    refuse: Mapping[str, tuple[float, float]]
    digits: int
    message: str


_INF = math.inf
MIN_SPEED = 0.3  # m/s
_KINDS = ("walk", "run", "motion")


def _all_kinds(*, most: float) -> dict[str, tuple[float, float]]:
    return dict.fromkeys(_KINDS, (-_INF, most))


def _gaits(least: float = -_INF, most: float = _INF) -> dict[str, tuple[float, float]]:
    return dict.fromkeys(("walk", "run"), (least, most))


def _ground(key: str, factor: float) -> Callable[[Report], float | None]:
    return lambda report: _scaled(report.get("ground", {}).get(key), factor)


def _measure(key: str, factor: float) -> Callable[[Report], float | None]:
    """A measure of the final motion; of the root path, if the report has none."""
    return lambda report: _scaled(report.get("measures", report.get("ground", {})).get(key), factor)


def _scaled(value: float | None, factor: float) -> float | None:
    return None if value is None else factor * value


def _knee_peak(of_both: Callable[[Iterable[float]], float]) -> Callable[[Report], float | None]:
    """The peak flexion of one knee: `min` for the less, `max` for the more flexed one."""
    sides = ("knee_left", "knee_right")
    return lambda report: float(of_both(report["range_deg"][side][1] for side in sides))


def _hip_fit(report: Report) -> float | None:
    scores = report.get("r2_loop_against_capture", {})
    known = [scores[name] for name in ("hip_left", "hip_right") if scores.get(name) is not None]
    return float(min(known)) if known else None


def _beyond(report: Report) -> float | None:
    return max(report.get("measures", {}).get("beyond_limits_deg", {}).values(), default=None)


def _speed_error(report: Report) -> float | None:
    """Per cent by which the body's speed differs from the capture's, scaled by the legs."""
    scaled, speed = report.get("speed_scaled_m_s"), report.get("speed_m_s")
    # On the spot, a share of the speed means nothing.
    if speed is None or scaled is None or abs(scaled) < MIN_SPEED:
        return None
    return float(100.0 * abs(speed / abs(scaled) - 1.0))


# Clearance applies to walks only: a runner's or jumper's foot leaves the ground without it. It is measured
# from a ground that the standing sole itself meets to some millimetres.
RULES: tuple[_Rule, ...] = (
    _Rule("penetration", _measure("penetration_m", 1e3), _all_kinds(most=10), _all_kinds(most=25),
          0, "the soles penetrate the ground by {value} mm (limit {limit:.0f})"),
    _Rule("floating", _measure("floating_m", 1e3), _all_kinds(most=15), _all_kinds(most=25),
          0, "the standing foot floats by {value} mm (limit {limit:.0f})"),
    _Rule("clearance", _ground("swing_clearance_m", 1e3), {"walk": (5, _INF)}, {"walk": (-5, _INF)},
          1, "a swinging foot clears the ground by {value} mm (limit {limit:.0f})"),
    _Rule("slip", _ground("slip_m_s", 1.0), _gaits(most=0.05), _gaits(most=0.15),
          2, "the planted foot slips at {value} m/s (limit {limit:.2f})"),
    _Rule("knee", _knee_peak(min), {"walk": (45, _INF), "run": (60, _INF)},
          {"walk": (35, 110), "run": (45, 155)}, 0, "peak knee flexion of {value}° (limit {limit:.0f}°)"),
    # One knee may bend far, as in a step over something.
    _Rule("knee", _knee_peak(max), {"walk": (-_INF, 85), "run": (-_INF, 140)}, {},
          0, "peak flexion of a knee of {value}° (limit {limit:.0f}°)"),
    _Rule("cadence", lambda report: report.get("cadence_steps_per_min"),
          {"walk": (80, 130), "run": (130, 200)}, {"walk": (50, 160), "run": (100, 240)},
          0, "cadence {value} steps/min (limit {limit:.0f})"),
    _Rule("fit", _hip_fit, _gaits(least=0.7), _gaits(least=0.4),
          2, "the hip curves of the strides agree only to R² {value} (limit {limit:.1f})"),
    _Rule("speed", _speed_error, _gaits(most=5), _gaits(most=30),
          0, "the body's speed is {value} % off the capture's, scaled by the legs (limit {limit:.0f})"),
    _Rule("strides", lambda report: report.get("strides_used"), _gaits(least=2.0), {},
          1, "only {value} strides (limit {limit:.0f}): too few to average out the noise of one"),
    _Rule("limits", _beyond, _all_kinds(most=0.5), _all_kinds(most=15),
          0, "a joint exceeds its range of motion by {value}° (limit {limit:.1f}°)"),
)  # fmt: skip


def check_report(report: Report) -> tuple[Finding, ...]:
    """The rules that a motion breaks, from the value of gait.json; refusals first."""
    found = [finding for rule in RULES for finding in _findings(rule, report)]
    return tuple(sorted(found, key=lambda finding: finding.severity != "refuse"))


def _findings(rule: _Rule, report: Report) -> Iterator[Finding]:
    value = rule.value(report)
    if value is None:
        return
    severities: tuple[tuple[Severity, Mapping[str, tuple[float, float]]], ...] = (
        ("refuse", rule.refuse),
        ("warn", rule.warn),
    )
    for severity, limits in severities:
        least, most = limits.get(report["kind"], (-_INF, _INF))
        if least <= value <= most:
            continue
        limit = least if value < least else most
        message = rule.message.format(value=_apart(value, limit, rule.digits), limit=limit)
        yield Finding(rule.name, severity, value, limit, message)
        return


def _apart(value: float, limit: float, digits: int) -> str:
    """A value beyond a limit, with as many more digits as it takes not to read like the limit itself."""
    texts = (f"{value:.{digits + more}f}" for more in range(4))
    return next((text for text in texts if float(text) != limit), f"{value:g}")


def require_trainable(run: Path, motion: Motion, *, anyway: bool = False) -> None:
    """Raise one KinemimicError with every rule that refuses a run's motion.

    anyway: skip the check. A motion without gait.json was not retargeted from a capture and passes.
    """
    if anyway or (report := report_of_run(run, motion)) is None:
        return
    refused = [finding.message for finding in check_report(report) if finding.severity == "refuse"]
    if refused:
        raise KinemimicError(
            f"{run / GAIT}: expected a motion that the humanoid can perform, found: {'; '.join(refused)}; "
            "take another part of the capture (retarget --segment), or train with --anyway"
        )
