"""What is wrong with whole frames and only a reader can see: repeated times, frames of zeros, far places."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.spans import frame_runs
from kinemimic.pipeline.quality.rules.defect import Defect, plural
from kinemimic.pipeline.readers.base.source import Source

# A depth camera sees 8 m far at most; what is ten times beyond that is no measurement.
FARTHEST = 100.0
# Lines in a row behind the clock that are more than a stutter.
_ANEW = 10


def in_sequence(clock: Array) -> tuple[Mask, list[Defect]]:
    """Which frames come later than all before them, and a defect that counts the others, to be dropped.

    clock: (T,) finite times or frame numbers as in the file. Lines that repeat a time now and then are
    repaired so; where the clock falls back and runs on, a recording is lost with them: that is flagged.
    """
    later = clock > np.concatenate([[-np.inf], np.maximum.accumulate(clock)[:-1]])
    count = int((~later).sum())
    if not count:
        return later, []
    text = f"{plural(count, 'line')} with the time of a line before, dropped"
    behind = _longest_behind(clock, later)
    if behind < _ANEW:
        return later, [Defect("duplicate_frames", count, "frames", "repaired", text)]
    text += (
        f"; {behind} of them follow one another, their clock behind but running: two recordings joined in "
    )
    text += "one file, or one time far too late?"
    return later, [Defect("duplicate_frames", count, "frames", "flagged", text)]


def _longest_behind(clock: Array, later: Mask) -> int:
    """The most lines in a row that are not later than all before, but each later than the one before it."""
    running = np.concatenate([[False], ~later[1:] & ~later[:-1] & (clock[1:] > clock[:-1])])
    edges = np.flatnonzero(np.diff(np.concatenate([[False], running, [False]]).astype(np.int8)))
    return 1 + int((edges[1::2] - edges[::2]).max(initial=0))


def zero_frames(points: Array) -> list[Defect]:
    """A defect that names the frames in which every joint stands on the sensor's origin: nobody was seen.

    points: (T, J, 3) as in the file. The frames stay, all joints missing, so that frame numbers do.
    """
    empty: Mask = np.logical_not(points.reshape(len(points), -1).any(axis=1))
    count = int(empty.sum())
    if not count:
        return []
    text = f"{plural(count, 'frame')} of zeros only: kept, with every joint missing"
    return [Defect("zero_frames", count, "frames", "repaired", text, frame_runs(empty))]


def refuse_far(points: Array, joints: Sequence[str], source: Source, line: Callable[[int], int]) -> None:
    """CaptureError for the first coordinate beyond FARTHEST; NaN and infinity say "not seen" and pass.

    points: (T, J, 3) metres; joints: (J,) as the file names them; line: number in the file of a frame.
    Where the user names another unit, they are not metres yet: then the leg judges them (rules/units.py).
    """
    if source.unit is not None:
        return
    # A comparison with NaN is False, so that only infinity needs a word.
    far = np.abs(points) > FARTHEST
    if far.any() and (far := far & np.isfinite(points)).any():
        frame, joint, axis = (int(k) for k in np.argwhere(far)[0])
        raise source.error(
            expected=f"metres, at most {FARTHEST:g}, in {joints[joint]}_{'XYZ'[axis]}",
            found=f"{points[frame, joint, axis]:g}",
            where=f"line {line(frame)}",
        )
