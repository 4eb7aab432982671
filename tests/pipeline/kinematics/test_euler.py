"""Euler channels of whole skeletons: the fast and the slow way to positions agree."""

from __future__ import annotations

import numpy as np
import pytest

from kinemimic.pipeline.kinematics.euler import positions_of_channels, rotations_of_channels, world_positions
from kinemimic.pipeline.kinematics.rotations import IDENTITY, ORDERS, from_axis_angle, normalize, to_matrix
from kinemimic.pipeline.kinematics.skeleton import Skeleton


@pytest.mark.parametrize("tilted", [False, True])
def test_positions_of_channels_are_those_of_forward_kinematics(tilted: bool) -> None:
    rng = np.random.default_rng(3)
    frames, joints = 1500, 16  # more frames than are worked on at once
    parents = (-1, *(int(rng.integers(0, joint)) for joint in range(1, joints)))
    skeleton = Skeleton(tuple(f"j{k}" for k in range(joints)), parents, rng.normal(size=(joints, 3)))
    orders = (*ORDERS, "ZXY", "XYZ", "", "")
    euler = rng.uniform(-4.0, 4.0, (frames, joints, 3))
    euler[:, 13, 1:] = 0.0
    euler[:, 14:] = 0.0
    translations = rng.normal(size=(frames, joints, 3))
    world = normalize(rng.normal(size=4))
    rests = normalize(rng.normal(size=(joints, 4))) if tilted else None
    slow = world_positions(skeleton, translations, rotations_of_channels(euler, orders, world, rests), world)
    fast = positions_of_channels(skeleton, translations, euler, orders, world, rests)
    np.testing.assert_allclose(fast, slow, atol=1e-12)


def test_a_rest_turns_the_frame_in_which_channels_turn() -> None:
    """A rest rotation of 90 degrees about Z, then 90 degrees of the X channel: a turn about the world's Y."""
    rests = from_axis_angle("Z", np.array([0.5 * np.pi]))
    q = rotations_of_channels(np.array([[[0.5 * np.pi, 0, 0]]]), ("XYZ",), np.array([0.0, 0, 0, 1]), rests)
    np.testing.assert_allclose(to_matrix(q)[0, 0] @ [0, 1, 0], to_matrix(rests)[0] @ [0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(to_matrix(q)[0, 0] @ [1, 0, 0], [0, 1, 0], atol=1e-12)


@pytest.mark.parametrize("order", ["YZX", "XYZ"])
def test_rotations_are_sign_continuous_where_a_channel_wraps(order: str) -> None:
    turn = np.linspace(0.0, 4.0 * np.pi, 50)
    euler = np.zeros((50, 2, 3))
    euler[:, 1, 0] = np.mod(turn + np.pi, 2.0 * np.pi) - np.pi
    q = rotations_of_channels(euler, (order, order), IDENTITY)
    assert (np.sum(q[1:] * q[:-1], axis=-1) > 0.99).all()


def test_positions_do_not_depend_on_the_block_that_a_frame_is_in() -> None:
    rng = np.random.default_rng(5)
    frames = 5000  # three blocks
    skeleton = Skeleton(("a", "b", "c"), (-1, 0, 1), np.zeros((3, 3)))
    moved, turned = rng.normal(size=(frames, 3, 3)), normalize(rng.normal(size=(frames, 3, 4)))
    turn = normalize(rng.normal(size=4))
    whole = world_positions(skeleton, moved, turned, turn)
    for frame in (0, 1023, 1024, 2048, 4999):
        one = slice(frame, frame + 1)
        np.testing.assert_array_equal(
            whole[one], world_positions(skeleton, moved[one], turned[one], turn), strict=True
        )
    assert world_positions(skeleton, moved[:0], turned[:0], turn).shape == (0, 3, 3)
