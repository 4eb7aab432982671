"""The sensor's errors, one at a time: each has its level and affects nothing else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from samples.noiseless import NOISELESS

from kinemimic.pipeline.kinematics.skeleton import INFERRED, MISSING, NODES, TRACKED
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.virtual_kinect.camera import Camera
from kinemimic.pipeline.virtual_kinect.noise import NoiseLevels, Observation, observe

# Lateral white noise at the reference distance, in mm: of the joint alone, and shared with other joints. Left
# and right are alike.
WHITE = {
    "hip_center": (2.0, 6.5),
    "spine": (2.0, 6.5),
    "shoulder_center": (4.0, 0.0),
    "head": (6.0, 0.0),
    "shoulder": (6.0, 0.0),
    "elbow": (6.0, 0.0),
    "wrist": (5.0, 12.0),
    "hand": (6.0, 12.0),
    "hip": (4.0, 6.5),
    "knee": (6.0, 0.0),
    "ankle": (3.0, 5.0),
    "foot": (5.0, 5.0),
}
WHITE_LEVELS = 1e-3 * np.array([
    np.hypot(*WHITE[node.removesuffix("_left").removesuffix("_right")]) for node in NODES
])  # fmt: skip
# The camera at the origin's height of the joints, so that the line of sight to a joint on the axis is +X.
CAMERA = Camera(height=0.0, tilt=0.0)


def _still(frames: int, distance: float) -> np.ndarray:
    """Every joint on the axis at a distance, feet a little before the ankles, hips and knees apart."""
    joints = np.zeros((frames, 20, 3))
    joints[..., 0] = distance
    for side, sign in (("left", 1.0), ("right", -1.0)):
        for joint in ("hip", "knee", "ankle", "foot"):
            joints[:, N[f"{joint}_{side}"], 1] = 0.1 * sign
        joints[:, N[f"foot_{side}"], 0] -= 0.1
    return joints


def _see(joints: np.ndarray, levels: NoiseLevels, *, heading: float = np.pi, seed: int = 0) -> Observation:
    frames = len(joints)
    rng = np.random.default_rng(seed)
    return observe(joints, np.full(frames, heading), np.arange(frames) / 30.0, CAMERA, levels, rng)


def test_without_defects_the_joints_come_out_as_they_are() -> None:
    joints = _still(20, 2.5)
    seen = _see(joints, NOISELESS)
    np.testing.assert_allclose(seen.positions, joints, atol=1e-12)
    assert not seen.swapped.any()


def test_white_noise_has_its_level_at_the_reference_distance_and_grows_with_the_square() -> None:
    levels = replace(NOISELESS, white=1.0)
    near, far = (
        _see(_still(4000, d), levels).positions - _still(4000, d)
        for d in (levels.distance, 2 * levels.distance)
    )
    # Across the line of sight, at joints on the axis.
    on_axis = [N["hip_center"], N["head"], N["wrist_left"], N["elbow_right"]]
    np.testing.assert_allclose(near[:, on_axis, 2].std(axis=0), WHITE_LEVELS[on_axis], rtol=0.05)
    np.testing.assert_allclose(far[:, on_axis].std(axis=0) / near[:, on_axis].std(axis=0), 4.0, rtol=0.01)
    np.testing.assert_allclose(
        near[:, on_axis, 0].std(axis=0) / near[:, on_axis, 2].std(axis=0), 1.5, rtol=0.1
    )


def test_the_levels_are_those_of_real_recordings() -> None:
    # In 3-D, along with the stretch along the line of sight.
    spatial = 1e3 * WHITE_LEVELS * np.sqrt(2 + NoiseLevels().depth ** 2)
    for joint in ("hip", "knee", "ankle"):
        assert 5.0 <= spatial[N[f"{joint}_left"]] <= 18.0
    assert spatial[N["wrist_left"]] == pytest.approx(30.0, abs=5.0)


def test_the_slow_error_is_slow() -> None:
    levels = replace(NOISELESS, bias=1.0)
    error = (_see(_still(6000, 2.7), levels).positions - _still(6000, 2.7))[:, N["knee_left"], 2]
    step = int(30 * levels.bias_time)
    near, later = (np.corrcoef(error[:-lag], error[lag:])[0, 1] for lag in (1, step))
    assert near > 0.95 and later == pytest.approx(np.exp(-1.0), abs=0.12)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_in_an_oblique_view_the_hips_turn_towards_the_sensor_and_draw_together(sign: float) -> None:
    levels = replace(NOISELESS, hip_yaw=0.25, hip_width=0.6)
    # Facing the sensor is a heading of 180 degrees; here the subject looks 40 degrees past it.
    heading = np.pi + sign * np.radians(40.0)
    turned = _see(_still(3, 3.0), levels, heading=heading).positions
    line = turned[0, N["hip_left"]] - turned[0, N["hip_right"]]
    assert np.linalg.norm(line) == pytest.approx(0.6 * 0.2)
    assert np.degrees(np.arctan2(line[0], line[1])) == pytest.approx(sign * 0.25 * 40.0)


def test_feet_point_down() -> None:
    seen = _see(_still(3, 2.0), replace(NOISELESS, foot_drop=np.radians(40.0))).positions
    sole = seen[:, N["foot_left"]] - seen[:, N["ankle_left"]]
    np.testing.assert_allclose(np.arctan2(-sole[:, 2], np.hypot(sole[:, 0], sole[:, 1])), np.radians(40.0))
    np.testing.assert_allclose(np.linalg.norm(sole, axis=1), 0.1)


def test_only_lost_joints_are_nan_with_state_0() -> None:
    seen = _see(_still(600, 2.5), replace(NOISELESS, flicker=0.1, lost=0.3))
    assert np.array_equal(np.isnan(seen.positions).all(axis=-1), seen.states == MISSING)
    assert np.array_equal(np.isnan(seen.positions).any(axis=-1), seen.states == MISSING)
    assert {MISSING, INFERRED, TRACKED} == set(np.unique(seen.states))
    assert np.all(seen.states[:, [N["hip_center"], N["spine"], N["hip_left"]]] == TRACKED)


def test_only_inferred_joints_have_an_inference_error() -> None:
    joints = _still(900, 2.7)
    seen = _see(joints, replace(NOISELESS, flicker=0.05, inferred=0.05))
    error = np.linalg.norm(seen.positions - joints, axis=-1)
    assert np.all(error[seen.states == TRACKED] < 1e-12)
    assert np.median(error[seen.states == INFERRED]) > 0.03


def test_legs_are_swapped_whole_where_they_cross_in_the_image() -> None:
    joints = _still(200, 3.0)
    joints[:, N["knee_right"], 1] = joints[:, N["knee_left"], 1] + np.linspace(-0.5, 0.5, 200)
    seen = _see(joints, replace(NOISELESS, swap=0.5, crossing=10.0))
    rows = np.flatnonzero(seen.swapped)
    assert 0 < len(rows) < 60 and np.all(np.abs(rows - 100) < 30)
    for joint in ("knee", "ankle", "foot"):
        left, right = N[f"{joint}_left"], N[f"{joint}_right"]
        np.testing.assert_allclose(seen.positions[rows][:, [left, right]], joints[rows][:, [right, left]])
    np.testing.assert_allclose(seen.positions[rows, N["hip_left"]], joints[rows, N["hip_left"]])


def test_only_the_edges_of_a_pass_are_disturbed() -> None:
    joints = _still(60, 2.5)
    error = np.linalg.norm(
        _see(joints, replace(NOISELESS, edge=0.12, edge_frames=(2, 5))).positions - joints, axis=-1
    )
    assert error[[0, 1, -2, -1], N["knee_left"]].max() > 0.05
    assert error[5:-5].max() < 1e-12
    assert error[:, N["hip_left"]].max() < 1e-12


def test_the_same_seed_sees_the_same() -> None:
    one, two, other = (_see(_still(60, 2.5), NoiseLevels(), seed=seed) for seed in (3, 3, 4))
    np.testing.assert_array_equal(one.positions, two.positions)
    assert not np.array_equal(one.positions, other.positions)
