"""Defects of whole frames that only a reader can see: repeated times, all-zero frames, remote coordinates."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.spans import frame_runs
from kinemimic.pipeline.quality.rules.defect import Defect, plural
from kinemimic.pipeline.readers.base.source import Source

# In metres. A depth camera reaches 8 m; a coordinate ten times beyond that is not a measurement.
MAX_COORDINATE = 100.0
# A run of this many late lines is more than a stutter of the clock.
_SECOND_RECORDING = 10


def increasing_times(clock: Array) -> tuple[Mask, list[Defect]]:
    """Mask of the frames that are later than all before them, and a defect that counts the others, which are
    dropped.

    clock: (T,) finite times or frame numbers as in the file. Occasional repeated times are repaired. If the
    clock jumps back and runs on, dropping those lines loses a whole recording: that is flagged.
    """
    later = clock > np.concatenate([[-np.inf], np.maximum.accumulate(clock)[:-1]])
    count = int((~later).sum())
    if not count:
        return later, []
    text = f"{plural(count, 'line')} with a time that is not later than before, dropped"
    run = _longest_late_run(clock, later)
    if run < _SECOND_RECORDING:
        return later, [Defect("duplicate_frames", count, "frames", "repaired", text)]
    text += f"; {run} of them are consecutive with increasing times: two recordings joined in "
    text += "one file, or a single time far too late?"
    return later, [Defect("duplicate_frames", count, "frames", "flagged", text)]


def _longest_late_run(clock: Array, later: Mask) -> int:
    """Length of the longest run of lines that are late, but each later than the previous one."""
    running = np.concatenate([[False], ~later[1:] & ~later[:-1] & (clock[1:] > clock[:-1])])
    edges = np.flatnonzero(np.diff(np.concatenate([[False], running, [False]]).astype(np.int8)))
    return 1 + int((edges[1::2] - edges[::2]).max(initial=0))


def zero_frames(points: Array) -> list[Defect]:
    """A defect listing the frames in which every joint is at the sensor's origin: nobody was tracked.

    points: (T, J, 3) as in the file. The frames are kept, with all joints missing, so that frame numbers stay
    valid.
    """
    empty: Mask = np.logical_not(points.reshape(len(points), -1).any(axis=1))
    count = int(empty.sum())
    if not count:
        return []
    text = f"{plural(count, 'frame')} with only zeros: kept, with every joint missing"
    return [Defect("zero_frames", count, "frames", "repaired", text, frame_runs(empty))]


def refuse_remote(points: Array, joints: Sequence[str], source: Source, line: Callable[[int], int]) -> None:
    """Raise CaptureError for the first coordinate beyond MAX_COORDINATE. NaN and infinity mean "not seen" and
    pass.

    points: (T, J, 3) metres; joints: (J,) names as in the file; line: line number of a frame. If the user
    names another unit, the values are not metres yet, and the check of the leg length applies instead
    (quality/rules/length_units.py).
    """
    if source.unit is not None:
        return
    # A comparison with NaN is False, so only infinity needs the second check.
    far = np.abs(points) > MAX_COORDINATE
    if far.any() and (far := far & np.isfinite(points)).any():
        frame, joint, axis = (int(k) for k in np.argwhere(far)[0])
        raise source.error(
            expected=f"metres, at most {MAX_COORDINATE:g}, in {joints[joint]}_{'XYZ'[axis]}",
            found=f"{points[frame, joint, axis]:g}",
            line=line(frame),
        )
