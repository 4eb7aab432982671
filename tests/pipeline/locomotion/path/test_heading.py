"""The heading comes from the pose: it turns with the walker and does not depend on the path."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from samples.walker import along, in_place, walker

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import IDENTITY, from_axis_angle, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.locomotion.path.heading import along_heading, body_heading, trunk_heading
from kinemimic.retarget.feet.scale import body_kinematics
from kinemimic.retarget.humanoid.body import STANDING_HEIGHT

RATE = 60.0


def off(found: Array, expected: Array | float) -> Array:
    """Degrees (T,) by which headings differ."""
    return np.degrees(np.abs(np.angle(np.exp(1j * (found - expected)))))


@pytest.mark.parametrize("turn", [0.7, 2.2, -2.9])
@pytest.mark.parametrize("noise", [0.0, 0.015])
def test_it_turns_with_the_positions(turn: float, noise: float) -> None:
    positions = walker(seconds=6.0, noise=noise).clip.positions
    straight, angle = body_heading(positions, RATE)
    turned, same = body_heading(rotate(from_axis_angle("Z", turn), positions), RATE)
    assert off(turned, straight + turn).max() < 1e-6
    assert same == pytest.approx(angle, abs=1e-6)


def test_it_does_not_depend_on_the_path() -> None:
    clip = walker(seconds=6.0, heading=1.0).clip
    drift = np.cumsum(np.random.default_rng(0).standard_normal((len(clip.times), 1, 2)), axis=0)
    elsewhere = clip.positions.copy()
    elsewhere[..., :2] += drift
    recorded = body_heading(clip.positions, RATE)[0]
    for positions in (in_place(clip).positions, elsewhere):
        assert off(body_heading(positions, RATE)[0], recorded).max() < 1e-6


@pytest.mark.parametrize("noise", [0.0, 0.015])
def test_a_straight_walk_has_the_heading_of_its_path(noise: float) -> None:
    found, angle = body_heading(walker(seconds=6.0, heading=2.2, noise=noise).clip.positions, RATE)
    assert off(found, 2.2).max() < 3.0
    assert np.degrees(np.median(angle)) < 15.0


@pytest.mark.parametrize("rate", [0.5, -1.0])
def test_a_walker_on_a_circle_is_followed_through_full_turns(rate: float) -> None:
    clip = walker(seconds=15.0).clip
    yaw = rate * clip.times
    found = body_heading(along(clip, yaw).positions, RATE)[0]
    inner = slice(60, -60)
    assert off(found[inner], yaw[inner]).max() < 5.0
    # Unwrapped: no jump by a turn.
    assert found[-60] - found[60] == pytest.approx(yaw[-60] - yaw[60], abs=np.radians(10.0))


def test_walking_backward_keeps_the_facing() -> None:
    clip = walker(seconds=6.0, heading=0.4).clip
    backward = replace(clip, positions=clip.positions[::-1].copy())
    assert off(body_heading(backward.positions, RATE)[0], 0.4).max() < 5.0


def test_a_turn_on_the_spot_by_180_degrees_is_followed() -> None:
    clip = walker(seconds=10.0).clip
    yaw = np.pi * np.clip((clip.times - 4.5) / 1.1, 0.0, 1.0)
    found = body_heading(along(clip, yaw).positions, RATE)[0]
    before, after = clip.times < 3.5, clip.times > 6.5
    assert off(found[before], 0.0).max() < 5.0 and off(found[after], np.pi).max() < 5.0


def test_axes_that_turn_with_the_heading_have_x_ahead() -> None:
    heading = np.array([0.0, 0.5 * np.pi])
    vectors = np.array([[1.0, 0.0, 3.0], [0.0, 1.0, 3.0]])
    assert along_heading(vectors, heading) == pytest.approx(np.array([[1.0, 0.0, 3.0]] * 2), abs=1e-12)
    assert along_heading(vectors[:, None], heading)[:, 0] == pytest.approx(along_heading(vectors, heading))


@pytest.mark.parametrize("degrees", [0.0, 100.0, -170.0])
def test_the_trunk_faces_ahead_also_where_the_ankles_part_sideways(degrees: float) -> None:
    """A jumping jack, with hips that a sensor does not show."""
    frames = 120
    upright = body_kinematics(np.tile(IDENTITY, (1, 20, 1)), np.array([[0.0, 0.0, STANDING_HEIGHT]]))[0]
    p = np.repeat(upright, frames, axis=0)
    apart = 0.3 * np.sin(np.pi * np.arange(frames) / 30.0) ** 2
    for side, sign in (("left", 1.0), ("right", -1.0)):
        for joint in ("ankle", "foot"):
            p[:, N[f"{joint}_{side}"], 1] += sign * apart
    turned = rotate(from_axis_angle("Z", np.radians(degrees)), p)
    for missing in ((), ("hip_left",)):
        turned[:, [N[node] for node in missing]] = np.nan
        assert trunk_heading(turned, 30.0) == pytest.approx(np.full(frames, np.radians(degrees)), abs=1e-9)
