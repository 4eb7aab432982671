"""Joint limits: known angles, both sides, derivatives."""

from __future__ import annotations

import numpy as np
import pytest
from samples.mirror import MIRROR

from kinemimic.pipeline.kinematics.rotations import (
    IDENTITY,
    angle_between,
    from_axis_angle,
    from_rotvec,
    multiply,
)
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.retarget.humanoid.limits import (
    LIMITS,
    beyond_limits,
    clamp_to_limits,
    swing_twist,
    swing_twist_jacobian,
)


def upright(frames=1):
    return np.tile(IDENTITY, (frames, 20, 1))


def test_the_neutral_pose_is_within_all_limits():
    assert beyond_limits(upright()) == {}


@pytest.mark.parametrize(
    ("joint", "axis", "degrees", "beyond"),
    [
        ("knee_left", "Y", 160.0, 10.0),
        ("knee_right", "Y", -9.0, 4.0),
        ("elbow_left", "Y", -155.0, 5.0),
        ("hip_left", "Y", -140.0, 5.0),  # flexion
        ("hip_right", "Y", 42.0, 12.0),  # extension
        ("hip_left", "X", 50.0, 5.0),  # outward
        ("hip_right", "X", 50.0, 20.0),  # inward
        ("ankle_left", "Y", -50.0, 5.0),  # toes up
        ("spine", "Z", 60.0, 15.0),
    ],
)
def test_a_joint_beyond_its_limit_is_named_with_the_angle(joint, axis, degrees, beyond):
    q = upright()
    q[:, N[joint]] = from_axis_angle(axis, np.radians([degrees]))
    found = beyond_limits(q)
    assert {name: np.degrees(angle) for name, angle in found.items()} == pytest.approx({joint: beyond})


def test_the_mirror_image_exceeds_its_limits_equally():
    q = upright(30)
    turns = np.random.default_rng(0).uniform(-2.0, 2.0, (30, 20, 3))
    q = from_rotvec(turns)
    image = q[:, MIRROR] * [-1, 1, -1, 1]
    other = beyond_limits(image)
    swapped = {
        name.replace("left", "*").replace("right", "left").replace("*", "right"): angle
        for name, angle in beyond_limits(q).items()
    }
    assert other == pytest.approx(swapped)


def test_swing_and_twist_recompose_the_rotation():
    swing, twist = np.array([0.7, -1.1, 0.0]), 0.9
    q = multiply(from_rotvec(swing), from_axis_angle("Z", twist))
    assert swing_twist(q) == pytest.approx([0.7, -1.1, 0.9])
    assert swing_twist(-q) == pytest.approx([0.7, -1.1, 0.9])


def test_jacobian_is_the_derivative_also_near_zero_swing():
    turns = np.random.default_rng(2).uniform(-1.2, 1.2, (40, 3))
    turns[:10] *= 1e-4
    q = from_rotvec(turns)
    after, before = (
        np.stack([swing_twist(multiply(q, from_rotvec(step * e))) for e in np.eye(3)], axis=-1)
        for step in (1e-6, -1e-6)
    )
    found = (after - before) / 2e-6
    assert swing_twist_jacobian(q)[1] == pytest.approx(found, abs=1e-7)


@pytest.mark.parametrize("joint", list(LIMITS))
def test_clamping_moves_only_joints_beyond_their_limits(joint):
    turns = np.random.default_rng(3).uniform(-1.5, 1.5, (50, 3))
    if joint.startswith(("knee", "elbow")):
        turns[:, [0, 2]] = 0.0
    q = from_rotvec(turns)
    kept = clamp_to_limits(joint, q)
    angles, limits = swing_twist(kept), LIMITS[joint]
    assert (angles > limits[:, 0] - 1e-6).all() and (angles < limits[:, 1] + 1e-6).all()
    inside = ((swing_twist(q) >= limits[:, 0]) & (swing_twist(q) <= limits[:, 1])).all(axis=-1)
    assert angle_between(kept[inside], q[inside]) == pytest.approx(0.0, abs=1e-6)
