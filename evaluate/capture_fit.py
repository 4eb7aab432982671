"""The simulated figure against the capture itself, before filtering and loop closing, and against the truth.

A capture and a rollout share no clock: they meet at the phase of the motion. For every captured frame the
simulated angle is read at the same phase of every cycle that the rollout walked, and all pairs are pooled.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from kinemimic.evaluate.fit import JointFit, joint_fits
from kinemimic.pipeline.angles import ANGLES
from kinemimic.pipeline.errors import CaptureError
from kinemimic.retarget.motion import Motion, joint_angles
from kinemimic.train.reference import Reference

Array = NDArray[np.float64]
Curves = Mapping[str, Array]


@dataclass(frozen=True)
class Capture:
    """N captured frames on the motion's phase.

    phase: (N,) in durations of the motion; raw, clean, truth: knee and hip (N,) in radians as read, after
    cleaning, and as the subject really moved (None unless the capture was simulated); NaN where missing.
    """

    phase: Array
    raw: Curves
    clean: Curves
    truth: Curves | None


def read_capture(path: Path) -> Capture | None:
    """Read the capture.parquet of `retarget`; None where that stage wrote none."""
    if not path.exists():
        return None
    try:
        table = pq.read_table(path)
    except (pa.ArrowInvalid, OSError) as error:
        found = str(error).splitlines()[0]
        raise CaptureError(
            path, expected="a table (Parquet)", found=found, advice="run retarget again"
        ) from None

    if "phase" not in table.column_names:
        raise CaptureError(path, expected="a column 'phase'", found="none", advice="run retarget again")
    phase = np.asarray(table["phase"].to_numpy(), dtype=np.float64)
    placed = np.isfinite(phase)

    def curves(prefix: str) -> dict[str, Array]:
        missing = [name for name in ANGLES if prefix + name not in table.column_names]
        if missing:
            found = f"no column {prefix + missing[0]!r}"
            raise CaptureError(path, expected="joint angles", found=found, advice="run retarget again")
        return {name: np.asarray(table[prefix + name].to_numpy(), np.float64)[placed] for name in ANGLES}

    truth = curves("truth_") if f"truth_{ANGLES[0]}" in table.column_names else None
    return Capture(phase[placed], curves(""), curves("clean_"), truth)


def simulated_at(
    phases: Array, angles: Curves, phase: Array, *, cyclic: bool
) -> tuple[NDArray[np.intp], Curves]:
    """The simulated angles at captured phases, once for every cycle in which the rollout passes them.

    phases: (F,) the rollout's own, not wrapped, increasing; angles: (F,) each, radians; phase: (N,) captured.
    Returns which captured frame each of the M pairs belongs to (M,), and the curves (M,). A cubic spline
    reads between control frames: at 30 Hz a straight line would cut almost a degree off the knee's peak.
    """
    first, last = phases[0], phases[-1]
    shifts = np.zeros(1)
    if cyclic and len(phase):
        shifts = np.arange(np.floor(first - phase.max()), np.ceil(last - phase.min()) + 1)
    at = phase[:, None] + shifts
    frame, column = np.nonzero((at >= first) & (at <= last))
    points = at[frame, column]
    return frame, {name: CubicSpline(phases, values)(points) for name, values in angles.items()}


def capture_fits(
    capture: Capture, phases: Array, angles: Curves, *, cyclic: bool, against: Curves | None = None
) -> dict[str, JointFit]:
    """Fit of a rollout to the capture, or to other curves of its frames, `against`; all cycles pooled."""
    frame, simulated = simulated_at(phases, angles, capture.phase, cyclic=cyclic)
    target = capture.raw if against is None else against
    return joint_fits({name: values[frame] for name, values in target.items()}, simulated)


def truth_fits(
    capture: Capture, motion: Motion, phases: Array, angles: Curves
) -> dict[str, dict[str, JointFit]] | None:
    """Where the error comes from: raw and cleaned capture, reference and rollout, each against the truth."""
    if capture.truth is None:
        return None
    simulated = capture_fits(capture, phases, angles, cyclic=motion.cyclic, against=capture.truth)
    return {
        "raw": joint_fits(capture.truth, capture.raw),
        "clean": joint_fits(capture.truth, capture.clean),
        "reference": joint_fits(capture.truth, joint_angles(Reference(motion).nodes(capture.phase))),
        "simulated": simulated,
    }
