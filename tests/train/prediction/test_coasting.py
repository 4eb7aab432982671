"""A motion that comes to rest, by hand-computed ways."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.kinematics.rotations import IDENTITY, angle_between, from_axis_angle
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.train.prediction.coasting import DECAY, SPAN, coasted


def test_a_pose_that_is_held_stays() -> None:
    root, rotations = np.tile([1.0, 2.0, 0.9], (9, 1)), np.tile(IDENTITY, (9, 20, 1))
    found, turned = coasted(root, rotations, 5)
    np.testing.assert_array_equal(found, root[:6])
    np.testing.assert_array_equal(turned, rotations[:6])


def test_a_velocity_decays() -> None:
    """Of 0.02 m and 0.1 rad a frame, a frame ahead 0.7 of it, two 0.7 + 0.49, and in all 7/3."""
    frames = np.arange(1 + SPAN)
    root = np.outer(0.02 * frames, [1.0, 0.0, 0.0])
    rotations = np.tile(IDENTITY, (1 + SPAN, 20, 1))
    rotations[:, N["knee_left"]] = from_axis_angle("Y", 0.1 * frames)
    found, turned = coasted(root, rotations, 60)
    ways = (found[:, 0] - root[-1, 0]) / 0.02
    np.testing.assert_allclose(ways[:3], [0.0, 0.7, 1.19], atol=1e-12)
    np.testing.assert_allclose(ways[-1], DECAY / (1.0 - DECAY), atol=1e-6)
    knee = turned[:, N["knee_left"]]
    np.testing.assert_allclose(angle_between(knee, knee[0]), 0.1 * ways, atol=1e-9)
    np.testing.assert_array_equal(turned[:, N["knee_right"]], np.tile(IDENTITY, (61, 1)))
