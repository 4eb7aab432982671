"""Fit of the simulation to the capture, before filtering and loop closing, and to the true motion.

Capture and rollout share no clock, only the phase of the motion: each captured frame is compared with the
simulated angles at the same phase of every cycle of the rollout, and all pairs are pooled.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.files.validation.schema import unchanged, upgraded
from kinemimic.pipeline.files.validation.tables import numbers, read_table
from kinemimic.pipeline.gait.curve_metrics import JointFit, joint_fits
from kinemimic.pipeline.kinematics.angles import ANGLES
from kinemimic.retarget.captured_angles import CAPTURED_SCHEMA
from kinemimic.retarget.formats.same_motion import require_same_motion
from kinemimic.retarget.humanoid.motion import Motion, joint_angles
from kinemimic.train.reference.reference import Reference

Curves = Mapping[str, Array]


@dataclass(frozen=True)
class Capture:
    """N captured frames by phase of the motion: all of the walks, or the part of a pass, it was made from.

    phase: (N,) in durations of the motion; used: (N,) whether the frame went into the motion; raw, adjusted,
    clean, truth: knee and hip angles (N,) in radians as read, with neutral pelvis and projected knees where
    the motion has them, also cleaned, and of the true motion (None unless the capture is simulated); NaN
    where missing; outside: number of further frames of these passes, which have no phase.
    """

    phase: Array
    used: Mask
    raw: Curves
    adjusted: Curves
    clean: Curves
    truth: Curves | None
    outside: int = 0

    def of_used(self) -> Capture:
        """The frames that went into the motion."""

        def kept(curves: Curves) -> Curves:
            return {name: values[self.used] for name, values in curves.items()}

        return Capture(
            self.phase[self.used],
            self.used[self.used],
            kept(self.raw),
            kept(self.adjusted),
            kept(self.clean),
            None if self.truth is None else kept(self.truth),
        )


def read_capture(path: Path, motion: Motion) -> Capture | None:
    """Read the capture.parquet of `retarget`; None if there is none.

    KinemimicError if it belongs to another motion.

    Schema 1 has adjusted angles of used frames only, under the names of those as read, which are then NaN.
    """
    if not path.exists():
        return None
    kind, advice = "a table (Parquet) of captured angles", "run retarget again"
    table, header = read_table(path, kind=kind, advice=advice)
    stated = header if isinstance(header, dict) else {}
    upgraded(
        stated,
        path,
        kind="captured angles",
        schema=CAPTURED_SCHEMA,
        advice=advice,
        upgrades={0: unchanged, 1: unchanged},
    )
    require_same_motion(path, stated.get("motion"), motion, stage="retarget")
    as_read = stated.get("schema", 0) > 1

    def column(name: str, kinds: str = "f") -> Array:
        try:
            return np.asarray(numbers(table, name, kinds))
        except ValueError as error:
            raise CaptureError(path, expected=kind, found=str(error), advice=advice) from None

    phase = np.asarray(column("phase"), dtype=np.float64)
    placed = np.isfinite(phase)

    def curves(prefix: str) -> dict[str, Array]:
        return {name: np.asarray(column(prefix + name), dtype=np.float64)[placed] for name in ANGLES}

    adjusted = curves("adjusted_" if as_read else "")
    return Capture(
        phase[placed],
        column("used", "b").astype(np.bool_)[placed] if as_read else np.ones(placed.sum(), dtype=np.bool_),
        curves("") if as_read else {name: np.full_like(values, np.nan) for name, values in adjusted.items()},
        adjusted,
        curves("clean_"),
        curves("truth_") if f"truth_{ANGLES[0]}" in table.column_names else None,
        outside=int((~placed).sum()),
    )


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
        "adjusted": joint_fits(capture.truth, capture.adjusted),
        "clean": joint_fits(capture.truth, capture.clean),
        "reference": joint_fits(capture.truth, reference),
        "simulated": capture_fits(capture, rollout, against=capture.truth),
    }


CHANGED = np.radians(0.5)  # less is rounding, and no other pose


def adjustments(capture: Capture, gait: Mapping[str, Any]) -> dict[str, float | None]:
    """What was done to the capture before it became the motion, as numbers of frames and strides.

    frames: of the passes; outside: not in the walks that the motion was made from; used: in the motion;
    trimmed: all the others; pelvis_neutral: of those used, by gait.json; hips_adjusted, knees_adjusted: of
    those used, with another angle than as read, since the pelvis was replaced by a neutral one or the knees
    were projected; strides_found, strides_used: by gait.json, those used each stretched in time to the
    motion's period, None unless the motion is a loop.
    """
    used = capture.of_used()

    def changed(joint: str) -> int:
        differences = [
            np.abs(used.raw[name] - used.adjusted[name]) for name in ANGLES if name.startswith(joint)
        ]
        return int(np.any([one > CHANGED for one in differences], axis=0).sum())

    neutral = gait.get("reliability", {}).get("pelvis") is False
    frames = len(capture.phase) + capture.outside
    return {
        "frames": frames,
        "outside": capture.outside,
        "used": len(used.phase),
        "trimmed": frames - len(used.phase),
        "pelvis_neutral": len(used.phase) if neutral else 0,
        "hips_adjusted": changed("hip"),
        "knees_adjusted": changed("knee"),
        "strides_found": gait.get("strides_found") if gait.get("cyclic") else None,
        "strides_used": gait.get("strides_used") if gait.get("cyclic") else None,
    }
