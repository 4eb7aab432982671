"""A person who is seen leaning stands upright after a while, wherever they face."""

from __future__ import annotations

import numpy as np
import pytest

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import (
    angle_between,
    conjugate,
    from_axis_angle,
    multiply,
    rotate,
)
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.retarget.feet.balance import LARGEST_LEAN, centre_of_mass
from kinemimic.retarget.feet.scale import body_kinematics
from kinemimic.retarget.live.lean import AVERAGE_TIME, FADE_TIME, LiveLean
from kinemimic.retarget.live.performer import standing

RATE = 30.0


def seen(lean: float, yaw: float) -> tuple[Array, Array]:
    """A person who stands at yaw, as a camera sees them that is tilted by `lean`; the soles are flat."""
    rotations = standing()
    ankles = {side: rotations[N[f"ankle_{side}"]].copy() for side in ("left", "right")}
    rotations[0] = from_axis_angle("Y", lean)
    for side, ankle in ankles.items():
        rotations[N[f"ankle_{side}"]] = multiply(from_axis_angle("Y", -lean), ankle)
    rotations[0] = multiply(from_axis_angle("Z", yaw), rotations[0])
    return rotations, np.array([0.3, -0.2, 0.9])


def off_feet(rotations: Array, root: Array) -> float:
    """Horizontal distance of the centre of mass from the ankles, m."""
    positions, frames = body_kinematics(rotations[None], root[None])
    ankles = 0.5 * (positions[0, N["ankle_left"]] + positions[0, N["ankle_right"]])
    return float(np.linalg.norm((centre_of_mass(positions, frames)[0] - ankles)[:2]))


@pytest.mark.parametrize("yaw", [0.0, 2.0])
def test_a_tilted_camera_is_levelled(yaw: float) -> None:
    lean, pose = LiveLean(RATE), seen(np.radians(8.0), yaw)
    assert off_feet(*pose) > 0.10
    for _ in range(round((AVERAGE_TIME + 3.0) * RATE)):
        rotations, root = lean.applied(*pose, yaw, on_the_spot=True)
    assert off_feet(rotations, root) < 0.08
    # About an axis across the heading; the soles stay as they are, and the ankles where they are.
    turn = multiply(rotations[0], conjugate(pose[0][0]))
    assert 0.03 < angle_between(rotations[0], pose[0][0]) < np.radians(8.0)
    across = rotate(from_axis_angle("Z", yaw), np.array([0.0, 1.0, 0.0]))
    assert abs(abs(turn[:3] @ across) / np.linalg.norm(turn[:3]) - 1.0) < 1e-6
    (before, frames), (after, turned) = (
        body_kinematics(q[None], r[None]) for q, r in (pose, (rotations, root))
    )
    feet = [N["ankle_left"], N["ankle_right"]]
    assert angle_between(turned[0, feet], frames[0, feet]).max() < 1e-6
    assert np.abs((after - before)[0, feet, :2]).max() < 0.01


def test_whoever_is_balanced_stays_as_they_are() -> None:
    lean, balanced = LiveLean(RATE), seen(0.0, 0.0)
    for _ in range(300):
        balanced = lean.applied(*seen(0.0, 0.0), 0.0, on_the_spot=True)
    other = LiveLean(RATE)
    for _ in range(60):
        rotations, root = other.applied(*balanced, 0.0, on_the_spot=True)
    assert angle_between(rotations[0], balanced[0][0]) < np.radians(0.2)
    assert np.abs(root - balanced[1]).max() < 0.005


def test_it_goes_out_smoothly_where_the_person_goes_away() -> None:
    lean, pose = LiveLean(RATE), seen(np.radians(-8.0), 0.0)
    for _ in range(90):
        before = lean.applied(*pose, 0.0, on_the_spot=True)[0]
    steps = []
    for _ in range(round((FADE_TIME + 0.2) * RATE)):
        rotations, root = lean.applied(*pose, 0.0, on_the_spot=False)
        steps.append(float(angle_between(rotations[0], before[0])))
        before = rotations
    np.testing.assert_array_equal(rotations, pose[0])
    np.testing.assert_array_equal(root, pose[1])
    assert 0.0 < max(steps) < np.radians(3.0)


def test_nobody_is_turned_by_more_than_a_sensor_is_tilted() -> None:
    lean, pose = LiveLean(RATE), seen(np.radians(50.0), 0.0)
    for _ in range(150):
        rotations, _ = lean.applied(*pose, 0.0, on_the_spot=True)
    assert angle_between(rotations[0], pose[0][0]) == pytest.approx(LARGEST_LEAN, abs=1e-6)
