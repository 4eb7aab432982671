"""Checks of values that a Kinect cannot have written; every error gives the place in the file."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.skeleton import INFERRED, MISSING, TRACKED
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.readers.base.frame_defects import increasing_times
from kinemimic.pipeline.readers.base.numbers import numbers_of, to_number
from kinemimic.pipeline.readers.base.source import Source

# The place in the file of a row of the arrays: "line 12", "frame 3".
Where = Callable[[int], str]

# Limits of the median time step in seconds: 33 ms for a Kinect, up to three or four times as long for a slow
# recorder.
STEPS = (0.005, 0.5)
# Limits of the length of a quaternion written with four digits or more.
_UNIT = (0.98, 1.02)


def begins_with_rows(source: Source, separator: str | None, is_row: Callable[[list[float]], bool]) -> bool:
    """True if at least three in four of the first 16 lines hold only numbers and pass `is_row`.

    One damaged line thus gets its own error, but words in the first line are a header, which none of these
    formats has. The head's last line may be cut off: it counts only if it is the only one.
    """
    lines = source.head[:-1][:16] or source.head
    first = lines[0].strip().split(separator)
    if sum(to_number(field) is None for field in first) > 0.5 * len(first):
        return False
    matching = 0
    for line in lines:
        row = numbers_of(line, separator)
        matching += row is not None and is_row(row)
    return matching >= 0.75 * len(lines)


def check_states(states: Array, joints: Sequence[str], where: Where, source: Source) -> None:
    """Raise CaptureError unless all states (T, J) are 0 (not seen), 1 (inferred) or 2 (tracked)."""
    wrong = (states != MISSING) & (states != INFERRED) & (states != TRACKED)
    if wrong.any():
        frame, joint = (int(k) for k in np.argwhere(wrong)[0])
        raise source.error(
            expected=f"a state of {joints[joint]}, 0, 1 or 2",
            found=f"{states[frame, joint]:g}",
            where=where(frame),
        )


def check_quaternions(quaternions: Array, joints: Sequence[str], where: Where, source: Source) -> None:
    """Raise CaptureError unless all quaternions (T, J, 4) have length 1; zeros or non-finite values mean
    "none"."""
    squared = np.einsum("...i,...i->...", quaternions, quaternions)
    wrong = (squared != 0.0) & ((squared < _UNIT[0] ** 2) | (squared > _UNIT[1] ** 2))
    if wrong.any():
        wrong &= np.isfinite(quaternions).all(axis=-1)
    if wrong.any():
        frame, joint = (int(k) for k in np.argwhere(wrong)[0])
        raise source.error(
            expected=f"a unit quaternion of {joints[joint]}",
            found=f"one of length {np.sqrt(squared[frame, joint]):.4g}",
            where=where(frame),
        )


def sensor_clock(times: Array, where: Where, source: Source) -> tuple[NDArray[np.bool_], list[Defect]]:
    """`increasing_times` of a sensor's clock (T,) in seconds.

    Raises CaptureError for a time that is not finite, and for a median step that no Kinect has: then the
    column does not hold times.
    """
    if not np.isfinite(times).all():
        bad = int(np.flatnonzero(~np.isfinite(times))[0])
        raise source.error(expected="a time", found="a non-finite number", where=where(bad))
    later, defects = increasing_times(times)
    step = float(np.median(np.diff(times[later]))) if later.sum() > 1 else STEPS[0]
    if not STEPS[0] <= step <= STEPS[1]:
        raise source.error(
            expected=f"times with steps of {1e3 * STEPS[0]:g} to {1e3 * STEPS[1]:g} ms",
            found=f"a median step of {1e3 * step:.4g} ms",
        )
    return later, defects
