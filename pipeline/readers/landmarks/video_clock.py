"""Times of a video's frames: a column or key with times, else the video's rate, else 30 Hz."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.readers.base.clock import seconds_of
from kinemimic.pipeline.readers.base.source import Source

# Of a video that says nothing about it.
RATE = 30.0


class VideoTimes(NamedTuple):
    """seconds: (K,) of the frames to keep; kept: their mask (T,); defects: frames that were dropped; note:
    how the times are known."""

    seconds: Array
    kept: Mask
    defects: list[Defect]
    note: str


def times_of_clock(clock: Array, name: str, source: Source, where: Callable[[int], str]) -> VideoTimes:
    """The times in a clock (T,), in the unit that its name states or its steps tell; as in `seconds_of`."""
    seconds, kept, defects, unit = seconds_of(clock, name, source, where)
    return VideoTimes(seconds, kept, defects, f"times in {unit} ({name})")


def times_of_rate(frames: int, rate: float, note: str) -> VideoTimes:
    """The times of frames that follow each other at a rate in Hz, beginning at zero."""
    return VideoTimes(np.arange(frames) / rate, np.ones(frames, dtype=np.bool_), [], note)
