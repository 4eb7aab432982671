"""The path over a belt: the body sways as in the room, and only the belt's speed comes from the feet."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from samples.bouts import bouts_of
from samples.walker import changing_bones, hips, on_belt, swaying, walker

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.body_points import place
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import from_axis_angle, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.locomotion.bouts import Bout
from kinemimic.pipeline.locomotion.path.belt import velocity_over_belt
from kinemimic.pipeline.locomotion.path.odometry import foot_odometry

SWAY = 0.025  # m


def sway_of(clip: Clip) -> Array:
    """Metres (T,) to the left, once there and back in a stride."""
    return SWAY * np.sin(2.0 * np.pi * clip.times / 1.1)


def on_the_belt(seconds: float = 8.0, heading: float = 0.0) -> Clip:
    clip = walker(seconds=seconds).clip
    spot = on_belt(swaying(clip, sway_of(clip)))
    return replace(spot, positions=rotate(from_axis_angle("Z", heading), spot.positions))


def aside(bout: Bout) -> Array:
    """Metres (n,) of the hips to the left of their straight path."""
    y = hips(bout.positions)[:, 0, 1]
    at = np.arange(len(y))
    return y - np.polyval(np.polyfit(at, y, 1), at)


def error(bout: Bout, clip: Clip) -> float:
    """Metres (rms) by which the hips of a bout sway otherwise than `sway_of` the clip."""
    sway = sway_of(clip)[bout.frames]
    at = np.arange(len(sway))
    return float(np.sqrt(np.mean((aside(bout) - sway + np.polyval(np.polyfit(at, sway, 1), at)) ** 2)))


@pytest.mark.parametrize("heading", [0.0, 0.7, -2.0])
def test_the_body_sways_as_in_the_room_in_whichever_direction_the_belt_runs(heading: float) -> None:
    clip = on_the_belt(heading=heading)
    (one,) = bouts_of(clip)
    assert one.precise and one.path.source == "feet"
    assert one.speed == pytest.approx(walker().speed, rel=0.05)
    assert error(one, clip) < 0.001


def test_a_belt_that_speeds_up_is_followed() -> None:
    """From 100 to 130 % of its speed, beneath a walker whose strides grow quicker."""
    clip = walker(seconds=20.0, faster=1.3).clip
    over = swaying(clip, sway_of(clip))
    x = hips(over.positions)[:, 0, 0]
    back = np.polyval(np.polyfit(clip.times, x, 2), clip.times)
    back = np.stack([back, 0.0 * back, 0.0 * back], axis=1)
    (one,) = bouts_of(replace(over, positions=over.positions - back[:, None]))
    gone = hips(one.positions)[:, 0, 0]
    for first, last in ((1.0, 6.0), (14.0, 19.0)):
        ends = np.searchsorted(clip.times[one.frames], [first, last])
        assert np.ptp(gone[ends]) == pytest.approx(np.ptp(x[one.frames[ends]]), rel=0.05)
    assert error(one, over) < 0.002


@pytest.mark.parametrize("point", ["hips", "hip_center"])
def test_a_body_that_is_held_in_its_place_sways_by_its_feet(point: str) -> None:
    """As in an animation on the spot: at the middle of the hips, or at the root, which their tilt moves."""
    clip = walker(seconds=8.0).clip
    over = swaying(clip, sway_of(clip))
    over.positions[:, N["hip_center"], 1] -= 0.2 * sway_of(clip)
    held = over.positions - place(over.positions, point)[:, None] * [1.0, 1.0, 0.0]
    (one,) = bouts_of(replace(over, positions=held))
    assert one.path.source == "feet"
    assert error(one, over) < 0.005


def test_before_a_camera_that_shakes_a_body_sways_by_its_feet() -> None:
    clip = on_the_belt()
    shake = 0.05 * np.sin(2.0 * np.pi * clip.times / 0.55)
    shaken = replace(clip, positions=clip.positions + np.stack([0.0 * shake, shake, 0.0 * shake], 1)[:, None])
    (one,) = bouts_of(shaken)
    assert error(one, clip) < 0.005


def test_the_sway_of_bones_that_vary_is_the_rooms() -> None:
    """As under skin markers in a run."""
    clip = on_the_belt()
    (one,) = bouts_of(changing_bones(clip))
    assert not one.precise and one.path.source == "feet"
    assert error(one, clip) < 0.001


def test_a_line_that_turns_is_no_belts() -> None:
    """By 2 degrees (rms): the sensor itself turns after the walker."""
    clip = on_the_belt()
    (one,) = bouts_of(clip)
    for veer in (0.0, np.radians(3.0)):
        turn = from_axis_angle("Z", veer * np.sin(2.0 * np.pi * clip.times / 5.0))
        positions = rotate(turn[:, None], clip.positions)[one.frames]
        feet = foot_odometry(positions, one.heading, one.phase, 60.0, toes=False)
        found = velocity_over_belt(positions, feet, one.phase, 60.0, precise=False)
        assert (found is None) == (veer > 0.0)


def test_few_strides_of_bones_that_vary_show_no_line() -> None:
    clip = on_the_belt(seconds=4.0)
    (one,) = bouts_of(clip)
    feet = foot_odometry(clip.positions, one.heading, one.phase, 60.0, toes=False)
    for precise in (False, True):
        found = velocity_over_belt(clip.positions, feet, one.phase, 60.0, precise=precise)
        assert (found is not None) == precise
