"""Which column or key is a clock, and which only looks like one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from samples import source_of

from kinemimic.pipeline.readers.base.column_names import words_of
from kinemimic.pipeline.readers.clocks.clock import UNITS, clock_of, is_rate, says_time, seconds_of

SECONDS = np.arange(40) / 60.0


def test_words_of_names() -> None:
    assert words_of("leftKnee.x") == ["left", "knee", "x"]
    assert words_of("L0_x") == ["l", "0", "x"]
    assert words_of("LEFT_KNEE (X)") == ["left", "knee", "x"]
    assert words_of("µs") == ["µs"]


@pytest.mark.parametrize(
    "name",
    ["Time (ms)", "timestampSec", "frame_time", "t", "ms", "seconds", "elapsed", "elapsed_ms", "t [s]"],
)
def test_names_of_a_clock(name: str) -> None:
    assert says_time(name)


@pytest.mark.parametrize("name", ["", "frame", "x", "t_shirt", "tx", "nose_x", "ms_per_frame"])
def test_other_names(name: str) -> None:
    assert not says_time(name)


def test_the_clock_is_the_first_that_runs_forward_as_a_camera_does() -> None:
    beside = {
        "inference_time": np.tile([30.0, 31.0, 29.0, 33.0], 10),  # a duration
        "frame_time": np.full(40, 16.7),
        "t": np.arange(40.0),  # counts frames: steps of a second, of a millisecond …
        "elapsed": SECONDS,
        "timestamp": 5.0 + SECONDS,
    }
    assert clock_of(beside) == "elapsed"
    assert clock_of({name: beside[name] for name in ("inference_time", "frame_time", "t")}) is None


@pytest.mark.parametrize(
    ("step", "name", "unit"),
    [
        (333_333.0, "timestamp", "100ns"),
        (166_667.0, "timestamp", "100ns"),
        (33_333.0, "timestamp", "µs"),
        (16_667.0, "timestamp", "µs"),
        (333_333.0, "timestamp_us", "µs"),
        (33_333_333.0, "timestamp", "ns"),
        (33.3, "timestamp", "ms"),
    ],
)
def test_the_unit_is_the_one_with_the_usual_step(step: float, name: str, unit: str) -> None:
    source = source_of("x", Path("a.json"))
    seconds, kept, _, found = seconds_of(step * np.arange(40.0), name, source, str)
    assert (found, kept.all()) == (unit, True)
    assert seconds[1] == pytest.approx(step * UNITS[unit])


def test_a_clock_in_which_times_are_repeated_and_begin_again() -> None:
    twice = np.repeat(SECONDS, 2)
    assert clock_of({"time": twice}) == "time"
    assert clock_of({"seconds": np.concatenate([SECONDS, SECONDS])}) == "seconds"


@pytest.mark.parametrize("values", [np.zeros(40), -SECONDS, 10.0 * np.arange(40), np.full(40, np.nan)])
def test_what_is_called_nothing_but_a_time_is_one_and_may_be_refused(values: np.ndarray) -> None:
    assert clock_of({"timestamp_s": values, "frame": np.arange(40.0)}) == "timestamp_s"


def test_rates() -> None:
    assert is_rate("fps")
    assert is_rate("videoFrameRate")
    assert not is_rate("frame")
