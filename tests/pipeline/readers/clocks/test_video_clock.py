"""Times of frames from their numbers, and from a rate."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from samples import source_of

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.readers.clocks.video_clock import Rate, VideoTimes, stated_rate, times_of_frames

COUNT = 60
EVEN = np.arange(COUNT)


def times(beside: dict[str, Array], rate: Rate | None = None) -> VideoTimes:
    source = source_of("", Path("pose.csv"))
    return times_of_frames(COUNT, beside, source, lambda row: f"row {row}", rate=rate)


@pytest.mark.parametrize(
    "name", ["frame", "frame_index", "frameId", "Frame Number", "frame_no", "video_frame"]
)
def test_a_missing_number_is_a_gap(name: str) -> None:
    there = np.delete(np.arange(90), np.s_[20:50])
    found = times({name: 7.0 + there})
    assert found.seconds == pytest.approx(there / 30.0)
    assert found.note == f"times are frame numbers ({name}) at 30 Hz, unless --rate says what it has"
    assert not found.defects


def test_every_third_frame_of_a_video() -> None:
    found = times({"frame": 3.0 * EVEN}, Rate(60.0, "fps"))
    assert found.seconds == pytest.approx(EVEN / 20.0)
    assert found.note == "times are frame numbers (frame) at 60 Hz (fps)"


def test_the_note_says_what_rate_replaces() -> None:
    found = times({"frame": 2.0 * EVEN})
    assert found.note == "times are frame numbers (frame) at 30 Hz: 15 Hz, unless --rate says what it has"


def test_numbers_without_gaps_say_what_the_rate_alone_does() -> None:
    for first in (0.0, 1.0, 104.0):
        np.testing.assert_array_equal(times({"frame": first + EVEN}).seconds, EVEN / 30.0)
    assert times({"index": 2.0 * EVEN, "id": 5.0 * EVEN}).note.startswith(
        "no time in the file: 30 Hz, unless"
    )


@pytest.mark.parametrize(
    "number",
    [
        np.zeros(COUNT),
        EVEN[::-1],
        EVEN % 20,
        EVEN // 20,
        EVEN + 0.5,
        33.3 * EVEN,
        100.0 * EVEN,
        np.where(EVEN == 5, np.nan, EVEN),
    ],
)
def test_what_does_not_count_frames_is_ignored(number: Array) -> None:
    found = times({"frames": np.full(COUNT, 60.0), "frame": np.asarray(number, dtype=np.float64)})
    np.testing.assert_array_equal(found.seconds, EVEN / 30.0)
    assert found.kept.all()


def test_a_frame_that_is_written_twice_is_read_once() -> None:
    found = times({"frame": EVEN // 2 + 0.0})
    np.testing.assert_array_equal(found.seconds, np.arange(COUNT // 2) / 30.0)
    (defect,) = found.defects
    assert (defect.rule, defect.count) == ("duplicate_frames", COUNT // 2)


def test_a_column_of_the_rate() -> None:
    assert times({"fps": np.full(COUNT, 50.0)}).seconds == pytest.approx(EVEN / 50.0)
    # How fast each frame was processed.
    assert times({"fps": 50.0 + EVEN % 3}).seconds == pytest.approx(EVEN / 30.0)


def test_stated_rates() -> None:
    source = source_of("", Path("pose.json"))
    for value in (60, 60.0, "60", " 60.0 "):
        assert stated_rate("fps", value, source) == (60.0, "fps")
    for value in ("fast", 0, 2000, [30], True, None, "nan"):
        with pytest.raises(CaptureError, match="expected 1 to 1000 frames per second in fps, found"):
            stated_rate("fps", value, source)
