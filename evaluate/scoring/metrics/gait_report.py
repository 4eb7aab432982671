"""gait_report.json: the gait metrics of every subject."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from kinemimic.evaluate.scoring.metrics.gait_norms import NORMS
from kinemimic.evaluate.scoring.metrics.gait_subjects import GaitSubject, reference, simulated
from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.gait.curves import curve_statistics, over_cycle
from kinemimic.pipeline.gait.parameters import normalised, parameters, symmetry_index
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.rollout.trajectory import Trajectory

GAIT_REPORT_SCHEMA = 3
JOINTS = ("knee", "hip", "ankle")


def gait_report(
    capture: GaitSubject | None, motion: Motion | None, trajectory: Trajectory | None
) -> dict[str, Any]:
    """Content of gait_report.json without provenance; subjects without a full stride are only listed."""
    candidates = {
        "capture": capture,
        "reference": reference(motion) if motion else None,
        "simulated": simulated(trajectory, motion) if motion and trajectory else None,
    }
    subjects = {name: subject for name, subject in candidates.items() if subject is not None}
    return {
        "schema": GAIT_REPORT_SCHEMA,
        "normative": {norm.name: norm.source for norm in NORMS},
        "subjects": {name: _metrics(subject) for name, subject in subjects.items() if subject.gait.strides},
        "without_a_stride": [name for name, subject in subjects.items() if not subject.gait.strides],
    }


def _metrics(subject: GaitSubject) -> dict[str, Any]:
    """Gait metrics of one subject; lengths in metres, angles in degrees, six significant digits."""
    study = subject.gait
    curves = {
        f"{joint}_{side}": _curve(subject, f"{joint}_{side}", None if study.running else joint)
        for joint in JOINTS
        for side in SIDES
        if f"{joint}_{side}" in subject.angles
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
        "stance_ratio_by_contact": _by_contact(subject),
        "curves": shown,
        "range_symmetry_percent": {
            joint: symmetry_index(*(shown[f"{joint}_{side}"]["range_deg"]["mean"] for side in SIDES))
            for joint in JOINTS
            if all(f"{joint}_{side}" in shown for side in SIDES)
        },
        "off_axis_knee_deg": _off_axis(subject),
        "notes": list(subject.notes),
    }
    rounded: dict[str, Any] = _rounded(value)
    return rounded


def _curve(subject: GaitSubject, name: str, joint: str | None) -> dict[str, Any] | None:
    return curve_statistics(_rows(subject, subject.angles[name], name.rsplit("_", 1)[1]), joint)


def _rows(subject: GaitSubject, curve: Array, side: str) -> Array:
    """A curve (T,) resampled over every stride of a side: (strides, 101)."""
    parts = []
    for group in subject.gait.feet:
        mine = subject.gait.groups == group
        strides = [s for s in subject.gait.strides if s.group == group and s.side == side]
        parts.append(over_cycle(subject.times[mine], curve[mine], strides))
    return np.concatenate(parts)


def _by_contact(subject: GaitSubject) -> dict[str, float] | None:
    """Share of the frames in which the simulation reports contact of each foot with the ground."""
    if subject.contacts is None:
        return None
    counts = subject.passes >= 0
    return {side: float(subject.contacts[counts, k].mean()) for k, side in enumerate(SIDES)}


def _off_axis(subject: GaitSubject) -> dict[str, dict[str, float]] | None:
    """RMS and largest value in degrees over the strides of each side."""
    if subject.off_axis is None:
        return None
    found: dict[str, dict[str, float]] = {}
    for side in subject.off_axis:
        rows = np.degrees(_rows(subject, subject.off_axis[side], side))
        rows = rows[np.isfinite(rows).all(axis=1)]
        if len(rows):
            # A spline through the zeros of a hinge may become slightly negative.
            found[side] = {"rms": float(np.sqrt(np.mean(rows**2))), "peak": float(np.abs(rows).max())}
    return found


def _rounded(value: Any) -> Any:
    """Six significant digits, so that platforms agree; curves to a thousandth of a degree."""
    if isinstance(value, Mapping):
        return {key: _rounded(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return [round(float(item), 3) + 0.0 for item in value]
    if isinstance(value, float):
        return float(f"{value:.6g}") if np.isfinite(value) else None
    return value
