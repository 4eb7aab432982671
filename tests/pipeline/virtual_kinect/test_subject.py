"""The subject's gait: a continuous loop, a straight path at the true speed, truth with the right signs."""

from __future__ import annotations

import numpy as np
import pytest
from peers.straight_walk import straight_walk

from kinemimic.pipeline.kinematics.rotations import angle_between
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.readers.mocap.deepmimic import read_deepmimic, stock_motion
from kinemimic.pipeline.virtual_kinect.subject import Gait, close_loop


@pytest.fixture(scope="module", params=["walk", "run"])
def gait(request: pytest.FixtureRequest) -> Gait:
    return close_loop(read_deepmimic(stock_motion(request.param)))


def test_a_cycle_later_the_pose_is_the_same_one_stride_ahead(gait: Gait) -> None:
    phase = np.linspace(-0.3, 1.2, 40)
    root, rotations = gait.pose(phase)
    later_root, later = gait.pose(phase + 1.0)
    np.testing.assert_allclose(later_root - root, np.broadcast_to([gait.stride, 0, 0], root.shape), atol=1e-9)
    np.testing.assert_allclose(later, rotations, atol=1e-9)


def test_no_joint_jumps_anywhere_in_the_cycle(gait: Gait) -> None:
    step = 1e-3
    root, rotations = gait.pose(np.arange(0.0, 1.0 + step, step))
    # A seam of 7 degrees would show as 7 degrees in one thousandth of a cycle.
    assert np.degrees(angle_between(rotations[:-1], rotations[1:])).max() < 1.5
    assert np.linalg.norm(np.diff(root, axis=0), axis=1).max() < 3.0 * gait.stride * step


def test_the_loop_stays_near_the_capture_away_from_its_seams() -> None:
    clip = read_deepmimic(stock_motion("walk"))
    assert clip.rotations is not None
    _, rotations = close_loop(clip).pose(np.linspace(0.0, 1.0, len(clip.times)))
    error = np.degrees(angle_between(rotations, clip.rotations))
    assert np.median(error[:, N["knee_left"]]) < 0.5
    assert np.percentile(error, 90) < 2.0


def test_the_path_is_straight_at_the_true_speed_in_any_direction() -> None:
    gait = close_loop(read_deepmimic(stock_motion("walk")))
    assert gait.speed == pytest.approx(1.23859 / (38 * 0.033332))
    elapsed = np.arange(4) * gait.period
    seen = straight_walk(gait, elapsed, start=np.array([4.0, 1.0]), heading=np.pi / 2, phase=0.4).joints
    steps = np.diff(seen[:, N["hip_center"]], axis=0)
    np.testing.assert_allclose(steps, np.broadcast_to([0.0, gait.stride, 0.0], steps.shape), atol=1e-9)
    assert np.linalg.norm(seen[0, N["hip_center"], :2] - [4.0, 1.0]) < 0.1


def test_the_truth_has_human_values_and_does_not_depend_on_the_direction() -> None:
    gait = close_loop(read_deepmimic(stock_motion("walk")))
    elapsed = np.linspace(0.0, gait.period, 200, endpoint=False)
    ahead = straight_walk(gait, elapsed, start=np.zeros(2), heading=0.0, phase=0.0)
    turned = straight_walk(gait, elapsed, start=np.ones(2), heading=2.5, phase=0.0)
    for name, curve in ahead.angles.items():
        np.testing.assert_allclose(turned.angles[name], curve, atol=1e-9)
    for side in ("left", "right"):
        knee, hip = (np.degrees(ahead.angles[f"{joint}_{side}"]) for joint in ("knee", "hip"))
        assert 0.0 < knee.min() < 6.0 and 70.0 < knee.max() < 80.0
        # The thigh is forward when that foot is ahead of the body, backward when it is behind.
        ahead_of = ahead.joints[:, N[f"ankle_{side}"], 0] - ahead.joints[:, N["hip_center"], 0]
        assert hip[np.argmax(ahead_of)] > 15.0 and hip[np.argmin(ahead_of)] < 0.0


def test_the_kinects_hip_centre_is_above_the_hips_and_its_foot_before_the_ankle() -> None:
    gait = close_loop(read_deepmimic(stock_motion("walk")))
    elapsed = np.linspace(0.0, gait.period, 60)
    joints = straight_walk(gait, elapsed, start=np.zeros(2), heading=0.0, phase=0.0).joints
    hips = 0.5 * (joints[:, N["hip_left"]] + joints[:, N["hip_right"]])
    np.testing.assert_allclose(joints[:, N["hip_center"], 2] - hips[:, 2], 0.07, atol=0.005)
    for side in ("left", "right"):
        ankle, foot = joints[:, N[f"ankle_{side}"]], joints[:, N[f"foot_{side}"]]
        standing = ankle[:, 2] < 0.08
        assert standing.mean() > 0.3 and np.all(foot[standing, 0] - ankle[standing, 0] > 0.07)
