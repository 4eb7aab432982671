"""Times of a video's frames: a column or key with times, else the frames' numbers at the video's rate, else
the rate alone; 30 Hz if nothing states it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.readers.base.column_names import words_of
from kinemimic.pipeline.readers.base.frame_defects import increasing_times
from kinemimic.pipeline.readers.base.json_text import numbers
from kinemimic.pipeline.readers.base.numbers import to_number
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.clocks.clock import STEPS, clock_of, is_rate, seconds_of
from kinemimic.pipeline.readers.clocks.frame_rate import HIGHEST, LOWEST

# Of a video that says nothing about it.
RATE = 30.0
_UNSTATED = ", unless --rate says what it has"
# Share of rows at which a frame's number changes: of several rows of a frame, all but one are dropped.
_CHANGES = 0.1
_FRAME_NUMBER = re.compile(r"(?:video)?frames?(?:i|ids?|idx|index|no|nr|num|number)?")


class VideoTimes(NamedTuple):
    """seconds: (K,) of the frames to keep; kept: their mask (T,); defects: frames that were dropped; note:
    how the times are known."""

    seconds: Array
    kept: Mask
    defects: list[Defect]
    note: str


class Rate(NamedTuple):
    """A frame rate in Hz, and the name under which the file states it; empty if it is assumed."""

    hertz: float
    name: str = ""


def times_of_frames(
    count: int,
    beside: Mapping[str, Array],
    source: Source,
    where: Callable[[int], str],
    *,
    rate: Rate | None = None,
    usual: float = RATE,
) -> VideoTimes:
    """The times of `count` frames; without a clock they begin at zero.

    beside: name -> a number of each frame (count,); rate: the one that the file states for all frames, if
    any; usual: the rate in Hz if it states none; where: place of a frame in the file. A missing number is a
    gap. Raises CaptureError for a damaged clock, as `seconds_of`.
    """
    name = clock_of(beside) if count > 1 else None
    if name is not None:
        seconds, kept, defects, unit = seconds_of(beside[name], name, source, where)
        return VideoTimes(seconds, kept, defects, f"times in {unit} ({name})")
    hertz, stated = rate or _column_of_rate(beside) or rate_apart(source) or Rate(usual)
    counts = (key for key, clock in beside.items() if is_frame_number(key) and _counts_frames(clock, hertz))
    name = next(counts, None)
    if name is None:
        note = f"no time in the file: {hertz:g} Hz{f' ({stated})' if stated else _UNSTATED}"
        return VideoTimes(np.arange(count) / hertz, np.ones(count, dtype=np.bool_), [], note)
    clock = beside[name]
    kept, defects = increasing_times(clock)
    seconds = (clock[kept] - clock[kept][0]) / hertz
    note = f"times are frame numbers ({name}) at {hertz:g} Hz"
    if stated:
        note += f" ({stated})"
    else:
        own = 1.0 / np.median(np.diff(seconds))
        note += f"{'' if np.isclose(own, hertz) else f': {own:.4g} Hz'}{_UNSTATED}"
    return VideoTimes(seconds, kept, defects, note)


def is_frame_number(name: str) -> bool:
    """Whether a column or key calls itself the number of a frame: "frame", "frameIndex"."""
    return _FRAME_NUMBER.fullmatch("".join(words_of(name))) is not None


def stated_rate(name: str, value: Any, source: Source) -> Rate:
    """The rate that a file states as a number, perhaps as text or alone in a list of arrays; CaptureError for
    anything else, and outside 1 to 1000 Hz."""
    rate = numbers(to_number(value) if isinstance(value, str) else value)
    if rate is None or rate.ndim or not LOWEST <= rate <= HIGHEST:
        raise source.error(
            expected=f"{LOWEST:g} to {HIGHEST:g} frames per second in {name[:40]}", found=repr(value)[:40]
        )
    return Rate(float(rate), name)


def rate_apart(source: Source) -> Rate | None:
    """The rate that the file states apart from the content, as another sheet of a workbook does."""
    return None if source.rate is None else Rate(source.rate, "stated in another sheet")


def _column_of_rate(beside: Mapping[str, Array]) -> Rate | None:
    """The rate that every frame repeats; how fast each was processed varies, and is none."""
    for name, values in beside.items():
        if is_rate(name) and LOWEST <= values[0] <= HIGHEST and (values == values[0]).all():
            return Rate(float(values[0]), name)
    return None


def _counts_frames(clock: Array, hertz: float) -> bool:
    """Whether these are numbers of frames: whole, never falling, and as close together as a camera's."""
    if not (np.abs(clock) < 2.0**53).all() or (clock != np.round(clock)).any():  # NaN too
        return False
    steps = np.diff(clock)
    forward = steps > 0.0
    if not forward.any() or forward.mean() < _CHANGES or (steps < 0.0).any():
        return False
    return float(np.median(steps[forward])) / hertz <= STEPS[1]
