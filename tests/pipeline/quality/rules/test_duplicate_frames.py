"""Repeated frames."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.quality.check import check_capture
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


def test_a_frozen_sensor_is_reported_and_the_pass_goes_on(moving: Moving) -> None:
    """The last pose for 0.3 s, four times: the frames are missing within one pass."""
    clip = moving(230, noise=0.003)
    places = (40, 90, 140, 190)
    for first in places:
        clip.positions[first + 1 : first + 9] = clip.positions[first]
    checked = check_capture(clip)
    found = {one.rule: one for one in checked.defects}
    frozen = found["duplicate_frames"]
    assert (frozen.count, frozen.action) == (32, "repaired")
    assert frozen.frames == tuple((first + 1, first + 8) for first in places)
    assert "at 1.37, 3.03, 4.70, 6.37 s" in frozen.text
    assert checked.acquisition.count == 1 and (checked.clip.passes == 0).all()
    assert found["gaps"].action == "flagged" and "0.27 s" in found["gaps"].text
    missing = np.isnan(checked.clip.positions).all(axis=(1, 2))
    assert missing.sum() == 32 and not (checked.clip.states[missing] > 0).any()
    assert len(checked.clip.times) == 230


def test_a_recorder_that_repeats_the_last_pose_after_the_person_left(moving: Moving) -> None:
    clip = moving(150, noise=0.003)
    clip.positions[100:] = clip.positions[99]
    checked = check_capture(clip)
    assert np.flatnonzero(checked.clip.passes >= 0).tolist() == list(range(100))
    assert checked.defects == ()
    assert [one.reason for one in checked.acquisition.events if one.frame == 106] == [
        "the last pose repeats for more than 0.2 s: nobody seen"
    ]


def test_euler_channels_lose_the_frames_of_a_freeze(moving: Moving) -> None:
    clip = moving(120)
    clip.positions[41:49] = clip.positions[40]
    channels = replace(
        clip,
        euler=np.full(clip.positions.shape, 0.1),
        orders=("ZYX",) * 20,
        translations=clip.positions.copy(),
    )
    repaired, (found,) = duplicate_frames.repair(channels)
    assert (found.count, len(repaired.times)) == (8, 112)
    assert duplicate_frames.repair(clip) == (clip, [])
