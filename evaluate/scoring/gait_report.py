"""What is measured of each who walks: gait_report.json."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from kinemimic.evaluate.scoring.gait_sources import Walker, reference, simulated
from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.gait.curves import cut, describe
from kinemimic.pipeline.gait.events import SIDES
from kinemimic.pipeline.gait.normative import SOURCE
from kinemimic.pipeline.gait.parameters import normalised, parameters, symmetry_index
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.rollout.trajectory import Trajectory

GAIT_REPORT_SCHEMA = 1
JOINTS = ("knee", "hip", "ankle")


def compare(capture: Walker | None, motion: Motion | None, trajectory: Trajectory | None) -> dict[str, Any]:
    """The JSON value of gait_report.json without its provenance; who makes no whole stride is only named."""
    walkers = {
        "capture": capture,
        "reference": reference(motion) if motion else None,
        "simulated": simulated(trajectory, motion) if motion and trajectory else None,
    }
    there = {name: walker for name, walker in walkers.items() if walker is not None}
    return {
        "schema": GAIT_REPORT_SCHEMA,
        "normative": SOURCE,
        "walkers": {name: describe_walker(walker) for name, walker in there.items() if walker.gait.strides},
        "without_a_stride": [name for name, walker in there.items() if not walker.gait.strides],
    }


def describe_walker(walker: Walker) -> dict[str, Any]:
    """All that is measured of one walker; lengths in metres, angles in degrees, numbers of six digits."""
    study = walker.gait
    curves = {
        f"{joint}_{side}": _curve(walker, f"{joint}_{side}", None if study.running else joint)
        for joint in JOINTS
        for side in SIDES
        if f"{joint}_{side}" in walker.angles
    }
    shown = {name: curve for name, curve in curves.items() if curve is not None}
    value = {
        "kind": "run" if study.running else "walk",
        "strides": {side: sum(s.side == side for s in study.strides) for side in SIDES},
        "strides_left_out": study.left_out,
        "treadmill_m_s": study.belt,
        "leg_length_m": study.leg,
        "parameters": parameters(study),
        "normalised": normalised(study),
        "stance_ratio_by_contact": _by_contact(walker),
        "curves": shown,
        "range_symmetry_percent": {
            joint: symmetry_index(*(shown[f"{joint}_{side}"]["range_deg"]["mean"] for side in SIDES))
            for joint in JOINTS
            if all(f"{joint}_{side}" in shown for side in SIDES)
        },
        "off_axis_knee_deg": _off_axis(walker),
        "notes": list(walker.notes),
    }
    rounded: dict[str, Any] = _rounded(value)
    return rounded


def _curve(walker: Walker, name: str, joint: str | None) -> dict[str, Any] | None:
    return describe(_rows(walker, walker.angles[name], name.rsplit("_", 1)[1]), joint)


def _rows(walker: Walker, curve: Array, side: str) -> Array:
    """A curve (T,) over the cycle of every stride of a side, (strides, 101)."""
    parts = []
    for group in walker.gait.feet:
        mine = walker.passes == group
        strides = [s for s in walker.gait.strides if s.group == group and s.side == side]
        parts.append(cut(walker.times[mine], curve[mine], strides))
    return np.concatenate(parts)


def _by_contact(walker: Walker) -> dict[str, float] | None:
    """Share of the frames in which the simulation says that each foot touches the ground."""
    if walker.contacts is None:
        return None
    counts = walker.passes >= 0
    return {side: float(walker.contacts[counts, k].mean()) for k, side in enumerate(SIDES)}


def _off_axis(walker: Walker) -> dict[str, dict[str, float]] | None:
    """Root mean square and largest value over the strides of each side."""
    if walker.off_axis is None:
        return None
    found: dict[str, dict[str, float]] = {}
    for side in SIDES:
        rows = np.degrees(_rows(walker, walker.off_axis[side], side))
        rows = rows[np.isfinite(rows).all(axis=1)]
        if len(rows):
            # A spline through a hinge's zeros may dip below them.
            found[side] = {"rms": float(np.sqrt(np.mean(rows**2))), "peak": float(np.abs(rows).max())}
    return found


def _rounded(value: Any) -> Any:
    """Six significant digits, which no platform's last bit disturbs; curves to a thousandth of a degree."""
    if isinstance(value, Mapping):
        return {key: _rounded(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return [round(float(item), 3) + 0.0 for item in value]
    if isinstance(value, float):
        return float(f"{value:.6g}") if np.isfinite(value) else None
    return value
