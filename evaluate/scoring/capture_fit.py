"""Fit of the simulation to the capture, before filtering and loop closing, and to the true motion.

Capture and rollout share no clock, only the phase of the motion: each captured frame is compared with the
simulated angles at the same phase of every cycle of the rollout, and all pairs are pooled.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.files.schema import unchanged, upgraded
from kinemimic.pipeline.files.tables import numbers, read_table
from kinemimic.pipeline.gait.curve_metrics import JointFit, joint_fits
from kinemimic.pipeline.kinematics.angles import ANGLES
from kinemimic.retarget.captured_angles import CAPTURED_SCHEMA
from kinemimic.retarget.humanoid.motion import Motion, joint_angles
from kinemimic.train.reference.reference import Reference

Curves = Mapping[str, Array]


@dataclass(frozen=True)
class Capture:
    """N captured frames by phase of the motion.

    phase: (N,) in durations of the motion; raw, clean, truth: knee and hip angles (N,) in radians as read,
    after cleaning, and of the true motion (None unless the capture is simulated); NaN where missing.
    """

    phase: Array
    raw: Curves
    clean: Curves
    truth: Curves | None


def read_capture(path: Path) -> Capture | None:
    """Read the capture.parquet of `retarget`; None if there is none."""
    if not path.exists():
        return None
    kind, advice = "a table (Parquet) of captured angles", "run retarget again"
    table, header = read_table(path, kind=kind, advice=advice)
    upgraded(
        header if isinstance(header, dict) else {},
        path,
        kind="captured angles",
        schema=CAPTURED_SCHEMA,
        advice=advice,
        upgrades={0: unchanged},
    )

    def column(name: str) -> Array:
        try:
            return np.asarray(numbers(table, name), dtype=np.float64)
        except ValueError as error:
            raise CaptureError(path, expected=kind, found=str(error), advice=advice) from None

    phase = column("phase")
    placed = np.isfinite(phase)

    def curves(prefix: str) -> dict[str, Array]:
        return {name: column(prefix + name)[placed] for name in ANGLES}

    truth = curves("truth_") if f"truth_{ANGLES[0]}" in table.column_names else None
    return Capture(phase[placed], curves(""), curves("clean_"), truth)


@dataclass(frozen=True)
class Rollout:
    """F frames of a rollout: phases (F,), unwrapped and increasing; knee and hip angles (F,) in radians.

    fallen_at: first frame of a fall, F or more if there is none; cyclic: whether phases recur in every cycle.
    """

    phases: Array
    angles: Curves
    fallen_at: int
    cyclic: bool

    def at(self, phase: Array) -> tuple[NDArray[np.intp], Curves, Mask]:
        """The simulated angles at captured phases (N,), once per cycle that contains the phase.

        Returns the captured frame of each of the M pairs (M,), the angles (M,), and whether the humanoid was
        upright (M,). Cubic splines interpolate between control frames: at 30 Hz, linear interpolation would
        cut almost a degree off the knee's peak.
        """
        first, last = self.phases[0], self.phases[-1]
        shifts = np.zeros(1)
        if self.cyclic and len(phase):
            shifts = np.arange(np.floor(first - phase.max()), np.ceil(last - phase.min()) + 1)
        at = phase[:, None] + shifts
        frame, column = np.nonzero((at >= first) & (at <= last))
        points = at[frame, column]
        curves = {name: CubicSpline(self.phases, values)(points) for name, values in self.angles.items()}
        fallen = self.fallen_at < len(self.phases)
        upright = points < self.phases[self.fallen_at] if fallen else np.ones(len(points), dtype=np.bool_)
        return frame, curves, upright


def capture_fits(capture: Capture, rollout: Rollout, *, against: Curves | None = None) -> dict[str, JointFit]:
    """Fit of a rollout to the capture, or to other curves of its frames (`against`), over all cycles."""
    frame, simulated, upright = rollout.at(capture.phase)
    target = capture.raw if against is None else against
    return joint_fits({name: values[frame] for name, values in target.items()}, simulated, upright)


def truth_fits(capture: Capture, motion: Motion, rollout: Rollout) -> dict[str, dict[str, JointFit]] | None:
    """Errors by stage: fits of raw and cleaned capture, reference and rollout to the truth."""
    if capture.truth is None:
        return None
    reference = joint_angles(Reference(motion).nodes(capture.phase))
    return {
        "raw": joint_fits(capture.truth, capture.raw),
        "clean": joint_fits(capture.truth, capture.clean),
        "reference": joint_fits(capture.truth, reference),
        "simulated": capture_fits(capture, rollout, against=capture.truth),
    }
