"""Absolute orientations become child-to-parent rotations and come back when multiplied down the tree."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.kinematics import rotations as r
from kinemimic.pipeline.kinematics.clip import forward_kinematics
from kinemimic.pipeline.readers.base.absolute_orientations import child_to_parent
from kinemimic.pipeline.readers.kinect.azure_joints import WORLD_FROM_CAMERA, azure_skeleton
from kinemimic.pipeline.readers.kinect.kinect_v2 import KINECT_V2_JOINTS, kinect_v2_skeleton


def turns(frames: int, joints: int) -> np.ndarray:
    return r.normalize(np.random.default_rng(5).normal(size=(frames, joints, 4)))


def test_the_tree_gives_the_orientations_back() -> None:
    for skeleton, world in ((kinect_v2_skeleton(), r.Y_UP_TO_Z_UP), (azure_skeleton(), WORLD_FROM_CAMERA)):
        absolute = turns(40, len(skeleton.names))
        local = child_to_parent(1.003 * absolute, skeleton, world)
        assert np.allclose(np.linalg.norm(local, axis=-1), 1.0)
        assert (np.sum(local[1:] * local[:-1], axis=-1) >= 0).all()
        places = np.zeros((40, len(skeleton.names), 3))
        again = forward_kinematics(skeleton, places, local)[1]
        assert np.abs(np.sum(again * r.multiply(world, absolute), axis=-1)).min() > 1 - 1e-12


def test_missing_orientations_stay_missing() -> None:
    skeleton = kinect_v2_skeleton()
    absolute = turns(10, 25)
    absolute[:, KINECT_V2_JOINTS.index("Head")] = 0.0
    absolute[4, KINECT_V2_JOINTS.index("KneeLeft")] = np.nan
    absolute[6, KINECT_V2_JOINTS.index("SpineBase")] = [np.inf, 0.0, 0.0, 0.0]
    local = child_to_parent(absolute, skeleton, r.Y_UP_TO_Z_UP)
    missing = np.isnan(local[..., 0])
    expected = np.zeros((10, 25), dtype=bool)
    expected[:, KINECT_V2_JOINTS.index("Head")] = True
    # Without the knee neither its own turn in the thigh nor the ankle's turn in the shank is known.
    expected[4, [KINECT_V2_JOINTS.index("KneeLeft"), KINECT_V2_JOINTS.index("AnkleLeft")]] = True
    expected[
        6, [KINECT_V2_JOINTS.index(name) for name in ("SpineBase", "SpineMid", "HipLeft", "HipRight")]
    ] = True
    assert np.array_equal(missing, expected)


def test_camera_axes_in_world_axes() -> None:
    axes = r.rotate(WORLD_FROM_CAMERA, np.eye(3))
    # Right of the camera, down, away from it.
    assert np.allclose(axes, [[0, -1, 0], [0, 0, -1], [1, 0, 0]], atol=1e-15)
