"""Defects of whole frames that only a reader can see: repeated times, all-zero frames, remote coordinates."""

from __future__ import annotations

import warnings
from bisect import bisect_left
from collections.abc import Callable, Sequence

import numpy as np

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.spans import frame_runs
from kinemimic.pipeline.plural import plural
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.quality.rules.length_units import UNITS
from kinemimic.pipeline.readers.base.source import Source

# In metres. A depth camera reaches 8 m; a coordinate ten times beyond that is not a measurement, …
MAX_COORDINATE = 100.0
# … except where the whole body is: people walk far, and a map's origin may be kilometres away.
MAX_DISTANCE = 1e5
_REMOTE_ADVICE = (
    f"a whole body may be up to {MAX_DISTANCE / 1000:g} km away, but not one joint, or for one frame; "
    "set another unit with --unit"
)
# Fewer joints are not a body.
_FEWEST_JOINTS = 3
# Metres from the middle of the body: of joints in another unit, usually millimetres.
_LARGEST_BODY = 10.0
# A run of this many late lines is more than a stutter of the clock.
_SECOND_RECORDING = 10


def increasing_times(clock: Array) -> tuple[Mask, list[Defect]]:
    """Mask of frames whose times increase, and a defect that counts the others, which are dropped.

    clock: (T,) finite times or frame numbers as in the file. Kept are the frames that are later than all
    before them, or more, if dropping a few others allows it: after a single time far too late, nothing would
    be later. If the clock jumps back and runs on, dropping those lines loses a whole recording: that is
    flagged.
    """
    later = clock > np.concatenate([[-np.inf], np.maximum.accumulate(clock)[:-1]])
    kept = later
    if not later.all():
        longest = _longest_increasing(clock)
        # Not from the middle of one recording into that of another.
        if longest.sum() > later.sum() and _longest_dropped_run(clock, longest) < _SECOND_RECORDING:
            kept = longest
    count = int((~kept).sum())
    if not count:
        return kept, []
    text = f"{plural(count, 'line')} with a time that is not later than before, dropped"
    run = _longest_dropped_run(clock, kept)
    if run < _SECOND_RECORDING:
        return kept, [Defect("duplicate_frames", count, "frames", "repaired", text)]
    text += f"; {run} of them are consecutive with increasing times: two recordings joined in one file?"
    return kept, [Defect("duplicate_frames", count, "frames", "flagged", text)]


def _longest_increasing(clock: Array) -> Mask:
    """Mask (T,) of a longest strictly increasing subsequence (Fredman 1975, On computing the length of
    longest increasing subsequences)."""
    kept = np.zeros(len(clock), dtype=np.bool_)
    ends: list[float] = []  # the smallest last time of an increasing subsequence of each length
    places: list[int] = []  # where that is
    before = np.full(len(clock), -1)
    for index, time in enumerate(clock.tolist()):
        length = bisect_left(ends, time)
        before[index] = places[length - 1] if length else -1
        if length == len(ends):
            ends.append(time)
            places.append(index)
        elif time < ends[length]:
            ends[length], places[length] = time, index
    index = places[-1] if places else -1
    while index >= 0:
        kept[index] = True
        index = before[index]
    return kept


def _longest_dropped_run(clock: Array, kept: Mask) -> int:
    """Length of the longest run of dropped lines, each later than the previous one."""
    running = np.concatenate([[False], ~kept[1:] & ~kept[:-1] & (clock[1:] > clock[:-1])])
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


def refuse_remote(
    points: Array,
    joints: Sequence[str],
    source: Source,
    where: Callable[[int], str] = lambda frame: f"frame {frame}",
    *,
    unit: str = "m",
    any_unit: bool = False,
) -> None:
    """Raise CaptureError for the first coordinate that is not a measurement (see `_remote`).

    points: (T, J, 3) metres; joints: (J,) names as in the file; where: place of a frame in the file; unit: of
    the file's numbers, for the message. If the user names another unit, or the whole body is too large and
    `any_unit` is set, the values are not metres yet, and the check of the leg length applies instead
    (quality/rules/length_units.py).
    """
    if source.unit is None and (found := _remote(points)) is not None:
        if any_unit and _is_too_large(points):
            return
        frame, joint, axis = found
        raise source.error(
            expected=f"at most {MAX_COORDINATE / UNITS[unit]:g} {unit} in {'XYZ'[axis]} of {joints[joint]}",
            found=f"{points[frame, joint, axis] / UNITS[unit]:g}",
            where=where(frame),
            advice=_REMOTE_ADVICE,
        )


def _remote(points: Array) -> tuple[int, int, int] | None:
    """Frame, joint and axis of the first coordinate that is not a measurement, or None. NaN and infinity
    mean "not seen" and pass.

    points: (T, J, 3) metres. Any coordinate up to MAX_COORDINATE passes. One beyond is a measurement if the
    whole body is there, as in a long walk or far from a laboratory's origin: no joint is farther than that
    from the middle of its frame's body, nor that middle farther from the one of the frame before.
    """
    far = np.abs(points) > MAX_COORDINATE
    if not far.any() or not (far := far & np.isfinite(points)).any():
        return None
    seen = np.isfinite(points) & points.any(axis=-1, keepdims=True)
    places = np.where(seen, points, np.nan)
    wrong: Mask = far & ~(np.abs(points) <= MAX_DISTANCE)
    if not wrong.any():
        wrong = _apart(places) if (seen.any(axis=-1).sum(axis=1) >= _FEWEST_JOINTS).any() else far
    if not wrong.any():
        return None
    frame, joint, axis = (int(k) for k in np.argwhere(wrong)[0])
    return frame, joint, axis


def _is_too_large(points: Array) -> bool:
    """Whether the joints (T, J, 3) are typically farther from the middle of their body than a person's."""
    seen = np.isfinite(points).all(axis=-1) & points.any(axis=-1)
    whole = points[seen.sum(axis=1) >= _FEWEST_JOINTS]
    places = np.where(np.isfinite(whole) & whole.any(axis=-1, keepdims=True), whole, np.nan)
    with np.errstate(over="ignore"):
        away = np.linalg.norm(places - np.nanmedian(places, axis=1, keepdims=True), axis=-1)
    away = away[np.isfinite(away)]
    return len(away) > 0 and float(np.median(away)) > _LARGEST_BODY


def _apart(places: Array) -> Mask:
    """The coordinates (T, J, 3) that are far from their frame's body, or in a frame far from the one before;
    places: NaN where not seen."""
    present = np.flatnonzero(np.isfinite(places).any(axis=(1, 2)))
    there = places[present]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # an axis that no joint of a frame has
        middle = np.nanmedian(there, axis=1)
        usual = np.nanmedian(middle, axis=0)
    wrong = np.zeros(places.shape, dtype=bool)
    wrong[present] = np.abs(there - middle[:, None]) > MAX_COORDINATE
    leaps = np.abs(np.diff(middle, axis=0)) > MAX_COORDINATE * np.diff(present)[:, None]
    for step, axis in np.argwhere(leaps):
        # Of the two frames, the one that is farther from where the body usually is.
        off = np.abs(middle[step : step + 2, axis] - usual[axis])
        frame = present[step + int(off[1] >= off[0])]
        wrong[frame, :, axis] = np.isfinite(places[frame, :, axis])
    return wrong
