"""Seconds of dates and of times of day."""

from __future__ import annotations

import numpy as np
import pytest

from kinemimic.pipeline.readers.clocks.dates import seconds_of_dates


def test_dates_and_zones() -> None:
    dates = ["1970-01-02T00:00:01.5", "1970-01-02 00:00:01,5", "1970-01-02T02:00:01.5+02:00"]
    assert [*seconds_of_dates(dates)] == [86_401.5] * 3


def test_times_of_day_run_on_after_midnight() -> None:
    times = ["9:00:00", "23:59:59.75", "00:00:00.25", "00:00:00.20", "23:00:00", "00:00:01"]
    day = 86_400.0
    assert [*seconds_of_dates(times)] == pytest.approx(
        [9 * 3600.0, day - 0.25, day + 0.25, day + 0.2, day + 23 * 3600.0, 2 * day + 1.0]
    )


def test_a_clock_of_twelve_hours_runs_on() -> None:
    times = ["12:59:59.9", "01:00:00.0", "1:00:00.1", "12:59:59", "1:00:00"]
    noon = 43_200.0
    assert [*seconds_of_dates(times)] == pytest.approx(
        [noon + 3599.9, noon + 3600.0, noon + 3600.1, 2 * noon + 3599.0, 2 * noon + 3600.0]
    )
    halves = ["11:59:59 AM", "12:00:00 PM", "1:00:00 p.m.", "11:59:59 PM", "12:00:00 AM"]
    assert [*seconds_of_dates(halves)] == [noon - 1.0, noon, noon + 3600.0, 2 * noon - 1.0, 2 * noon]


def test_a_clock_of_24_hours_that_goes_back_is_none_of_twelve() -> None:
    assert [*seconds_of_dates(["23:30:00", "11:15:00"])] == [84_600.0, 86_400.0 + 40_500.0]
    assert [*seconds_of_dates(["22:00:00", "10:30:00"])] == [79_200.0, 37_800.0]


@pytest.mark.parametrize(
    "text", ["10:11:12:066", "05/03/2024 10:11:12.066", "5.3.2024 10:11:12,066", "10:11:12.066 AM"]
)
def test_other_ways_to_write_a_time_of_day(text: str) -> None:
    assert [*seconds_of_dates([text])] == [10 * 3600.0 + 11 * 60.0 + 12.066]


def test_what_is_no_time() -> None:
    words = [
        "",
        "noon",
        "12",
        "10:11",
        "2024-05-03",
        "2024-13-03 10:11:12",
        "9999999-01-01T10:11:12",
        "1:2:3",
        "10:11:12:22",  # a timecode
        "10:11:12:1066",
    ]
    assert np.isnan([*seconds_of_dates(words)]).all()
