"""Dropped frames and an irregular clock."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.quality.rules import clock, duplicate_frames
from kinemimic.pipeline.quality.rules.frame_selection import select_frames

Moving = Callable[..., Clip]


def test_an_even_clock_in_milliseconds_has_no_defect(moving: Moving) -> None:
    clip = moving(120)
    assert clock.detect(clip) == []
    assert clock.detect(replace(clip, times=np.floor(1000 * clip.times) / 1000)) == []
    assert duplicate_frames.repair(clip) == (clip, [])


def test_missing_frames_are_counted(moving: Moving) -> None:
    whole = moving(120)
    missing = np.isin(np.arange(120), [20, 50, 51, 52, 90])
    (found,) = clock.detect(select_frames(whole, ~missing))
    assert (found.rule, found.count, found.unit) == ("dropped_frames", 5, "frames")
    assert "in 3 places" in found.text and "at most 3 in a row" in found.text
    # Frame 19 is the last before the first hole; behind each hole the frames have moved up by its width.
    assert found.frames == ((19, 19), (48, 48), (85, 85))


def test_every_second_frame_missing_at_times(moving: Moving) -> None:
    """Mostly steps of 2 and more, few of 1: the nominal step is the shorter one, and the clock is sparse."""
    keep = np.ones(240, dtype=np.bool_)
    keep[np.r_[1:180:2]] = False
    found = {defect.rule: defect.count for defect in clock.detect(select_frames(moving(240), keep))}
    assert found == {"dropped_frames": 90, "irregular_clock": 90}


def test_an_uneven_clock(moving: Moving) -> None:
    clip = moving(120)
    steps = np.resize([0.031, 0.046, 0.062], 119)
    (found,) = (
        defect
        for defect in clock.detect(replace(clip, times=np.concatenate([[0.0], np.cumsum(steps)])))
        if defect.rule == "irregular_clock"
    )
    assert found.count == 79  # 40 of 46 ms and 39 of 62; those of 31 explain more than the median does
    assert "usual 31 ms" in found.text


def test_a_step_between_passes_is_none(moving: Moving) -> None:
    clip = moving(120)
    times = clip.times + np.where(np.arange(120) >= 60, 0.7, 0.0)
    passes = np.repeat(np.array([0, 1], dtype=np.int32), 60)
    assert clock.detect(replace(clip, times=times, passes=passes)) == []


def test_stamps_that_nearly_coincide_are_no_faster_clock(moving: Moving) -> None:
    """As of recorders that write a repeated time a microsecond later."""
    clip = moving(300)
    times = clip.times.copy()
    times[5::10] = times[4:-1:10] + 1e-6
    found = {defect.rule: defect for defect in clock.detect(replace(clip, times=times))}
    assert found["irregular_clock"].count >= 30
    assert "dropped_frames" not in found
