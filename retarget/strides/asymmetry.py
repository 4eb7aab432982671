"""How far the sides of a walk differ, and how much of that noise explains."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.locomotion.bouts import Bout
from kinemimic.pipeline.locomotion.phase.frames import within
from kinemimic.retarget.humanoid.motion import joint_angles
from kinemimic.retarget.strides.loop import Loop, PooledFrames

# Difference of the sides that noise does not explain: in residuals about the loop, of which a leg that a
# depth sensor sees badly on most strides differs by up to 1.6; or in errors of the mean over the strides, of
# which the legs of Kinect walks differ by up to 2.2, from this many strides on that show both legs.
MAX_ASYMMETRY, MAX_ASYMMETRY_ERRORS, MIN_COMPARED_STRIDES = 2.0, 2.5, 3
WHOLE_STRIDE, MIN_STRIDE_FRAMES = 0.95, 10  # of a stride that is compared with others
_COMPARED = 40  # samples


def asymmetry_and_noise(loop: Loop, strides: PooledFrames, captured: dict[str, Array]) -> tuple[float, float]:
    """Rms difference of left and right, and rms residual about the loop, in degrees."""
    phase = np.arange(60) / 60.0
    left, right_later = joint_angles(loop.rotations(phase)), joint_angles(loop.rotations(phase + 0.5))
    fitted = joint_angles(loop.rotations(strides.phase))
    differences = [left[f"{joint}_left"] - right_later[f"{joint}_right"] for joint in ("knee", "hip")]
    residual = np.concatenate([captured[name] - fitted[name] for name in captured])
    return (
        float(np.degrees(np.sqrt(np.mean(np.square(differences))))),
        float(np.degrees(np.sqrt(np.nanmean(np.square(residual))))),
    )


def asymmetry_limit(
    bouts: Sequence[Bout], strides: PooledFrames, captured: dict[str, Array], noise: float
) -> float:
    """Difference of the sides in degrees that noise explains; smaller ones are averaged away by default.

    Only in a depth sensor's recording. It is explained if it is within the residuals of single frames, and if
    it does not return from stride to stride: noise without a preference for a side averages out.
    """
    limit = MAX_ASYMMETRY * noise
    rows = _side_differences(bouts, strides, captured)
    if len(rows) < MIN_COMPARED_STRIDES:
        return limit
    error = float(np.sqrt(np.mean(np.var(rows, axis=0, ddof=1) / len(rows))))
    return min(limit, MAX_ASYMMETRY_ERRORS * float(np.degrees(error)))


def _side_differences(bouts: Sequence[Bout], strides: PooledFrames, captured: dict[str, Array]) -> Array:
    """Left minus right (K, 2 n) in radians, of knees and hips over each whole stride that shows both legs.

    The right leg is compared half a stride later.
    """
    at = np.arange(_COMPARED) / _COMPARED
    begin, rows = 0, []
    for one in bouts:
        mine = slice(begin, begin + int(one.leg_mask().any(axis=1).sum()))
        begin = mine.stop
        phase = strides.phase[mine]
        for stride in one.strides:
            inside = within(phase, stride.start, stride.end)
            if not all(stride.used) or stride.cycles < WHOLE_STRIDE or inside.sum() < MIN_STRIDE_FRAMES:
                continue
            row = []
            for joint in ("knee", "hip"):
                left, right = (
                    np.interp(
                        stride.start + np.mod(at + late, 1.0), phase[inside], captured[name][mine][inside]
                    )
                    for name, late in ((f"{joint}_left", 0.0), (f"{joint}_right", 0.5))
                )
                row.append(left - right)
            rows.append(np.concatenate(row))
    return np.array([row for row in rows if np.isfinite(row).all()]).reshape(-1, 2 * _COMPARED)
