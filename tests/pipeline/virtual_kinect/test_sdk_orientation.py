"""Orientations from joints: perfect joints are reproduced; lost joints keep their last rotation."""

from __future__ import annotations

import numpy as np
import pytest
from peers.straight_walk import straight_walk

from kinemimic.pipeline.kinematics.clip import forward_kinematics
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.readers.mocap.deepmimic import read_deepmimic, stock_motion
from kinemimic.pipeline.virtual_kinect.sdk_orientation import calibrate, hold_last, joint_rotations
from kinemimic.pipeline.virtual_kinect.subject import close_loop


@pytest.fixture(scope="module")
def joints() -> np.ndarray:
    gait = close_loop(read_deepmimic(stock_motion("walk")))
    elapsed = np.arange(0.0, gait.period, 1 / 30)
    return straight_walk(gait, elapsed, start=np.array([4.0, 0.0]), heading=2.6, phase=0.0).joints


def test_perfect_joints_are_reproduced_by_the_skeleton(joints: np.ndarray) -> None:
    rotations = joint_rotations(joints)
    skeleton = calibrate(joints, np.ones(joints.shape[:2], dtype=np.bool_), rotations)
    translations = np.broadcast_to(skeleton.offsets, joints.shape).copy()
    translations[:, 0] = joints[:, 0]
    again, _ = forward_kinematics(skeleton, translations, rotations)
    legs = [N[f"{joint}_{side}"] for side in ("left", "right") for joint in ("hip", "knee", "ankle", "foot")]
    np.testing.assert_allclose(again[:, legs], joints[:, legs], atol=1e-6)
    # The trunk has its own frame between pelvis and shoulders, which on this figure turns with them.
    np.testing.assert_allclose(again, joints, atol=0.03)


def test_lost_joints_keep_the_last_known_rotation(joints: np.ndarray) -> None:
    holed = joints.copy()
    holed[10:13, N["ankle_left"]] = np.nan
    rotations, whole = joint_rotations(holed), joint_rotations(joints)
    assert np.isfinite(rotations).all()
    np.testing.assert_allclose(rotations[10:13, N["knee_left"]], whole[[9] * 3, N["knee_left"]], atol=1e-12)
    np.testing.assert_allclose(rotations[13:], whole[13:], atol=1e-12)
    np.testing.assert_allclose(rotations[:, N["knee_right"]], whole[:, N["knee_right"]], atol=1e-12)


def test_before_the_first_known_value_that_one_is_held() -> None:
    values = np.array([np.nan, np.nan, 3.0, np.nan, 5.0])[:, None, None]
    np.testing.assert_array_equal(hold_last(values)[:, 0, 0], [3.0, 3.0, 3.0, 3.0, 5.0])
