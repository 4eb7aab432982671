"""Repeated frames."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.quality.rules import duplicate_frames
from kinemimic.pipeline.quality.rules.frame_selection import select_frames

Moving = Callable[..., Clip]


def test_polling_faster_than_the_sensor(moving: Moving) -> None:
    """At 60 Hz every frame of a 30 Hz sensor is read twice; the frames of the sensor remain."""
    sensor = moving(60, noise=0.003)
    twice = np.repeat(np.arange(60), 2)
    polled = replace(
        select_frames(moving(120), np.ones(120, dtype=np.bool_)), positions=sensor.positions[twice]
    )
    repaired, (found,) = duplicate_frames.repair(polled)
    assert (found.rule, found.count, found.action) == ("duplicate_frames", 60, "repaired")
    assert np.array_equal(repaired.positions, sensor.positions)
    assert np.array_equal(repaired.times, polled.times[::2])


def test_standing_still_in_a_rounded_file_is_no_repeat(moving: Moving) -> None:
    """Whole millimetres at 240 Hz: no joint moves by one from frame to frame."""
    clip = moving(480, rate=240.0)
    sway = 0.002 * np.sin(clip.times)[:, None, None]
    still = replace(clip, positions=np.round(clip.positions[:1] + sway, 3))
    assert duplicate_frames.repair(still) == (still, [])


def test_repeats_with_missing_joints_and_outside_of_passes(moving: Moving) -> None:
    clip = moving(60)
    clip.positions[:, 3] = np.nan
    clip.positions[31] = clip.positions[30]
    clip.positions[51:55] = clip.positions[50]
    clip.passes[50:] = -1
    # Named is the frame that stays.
    assert duplicate_frames.repair(clip)[1][0].frames == ((30, 30),)
