"""Derivatives of the forward kinematics against finite differences, and rotations as a group."""

from __future__ import annotations

import numpy as np
import pytest

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.body_fit.body import LENGTHS, POINT_INDEX, SEGMENTS, UNKNOWNS
from kinemimic.pipeline.body_fit.pose import Poses, place, rotation_of, vector_of

HEIGHT, STEP = 1.7, 1e-6


def random_poses(frames: int, seed: int, spread: float = 0.6) -> Poses:
    rng = np.random.default_rng(seed)
    still = np.broadcast_to(np.eye(3), (frames, len(SEGMENTS), 3, 3)).copy()
    start = Poses(np.zeros((frames, 3)), still, np.zeros((frames, len(SEGMENTS))))
    return start.moved(rng.normal(0.0, spread, (frames, UNKNOWNS.count)))


@pytest.fixture
def factors() -> Array:
    return np.exp(np.random.default_rng(1).normal(0.0, 0.1, len(LENGTHS)))


def test_points_move_with_the_unknowns_as_the_derivatives_say(factors: Array) -> None:
    poses = random_poses(2, 0)
    placed = place(poses, factors, HEIGHT)
    for k in range(UNKNOWNS.count):
        step = np.zeros((2, UNKNOWNS.count))
        step[:, k] = STEP
        moved = place(poses.moved(step), factors, HEIGHT).points
        assert (moved - placed.points) / STEP == pytest.approx(placed.by_unknowns[..., k], abs=1e-5)


def test_points_move_with_the_lengths_as_the_derivatives_say(factors: Array) -> None:
    poses = random_poses(2, 2)
    placed = place(poses, factors, HEIGHT)
    for k in range(len(LENGTHS)):
        longer = factors.copy()
        longer[k] *= np.exp(STEP)
        moved = place(poses, longer, HEIGHT).points
        assert (moved - placed.points) / STEP == pytest.approx(placed.by_lengths[..., k], abs=1e-5)


def test_bones_keep_their_lengths_in_every_pose(factors: Array) -> None:
    placed = place(random_poses(50, 3), factors, HEIGHT)
    for length, start, end in (
        ("thigh", "hip", "knee"),
        ("shank", "knee", "ankle"),
        ("forearm", "elbow", "wrist"),
    ):
        for side in ("left", "right"):
            a, b = (placed.points[:, POINT_INDEX[f"{joint}_{side}"]] for joint in (start, end))
            share, _ = LENGTHS[length]
            expected = share * HEIGHT * factors[list(LENGTHS).index(length)]
            assert np.linalg.norm(a - b, axis=-1) == pytest.approx(np.full(50, expected))


def test_a_bent_knee_moves_the_ankle_backwards_and_a_bent_elbow_the_wrist_forwards() -> None:
    poses = random_poses(1, 4, spread=0.0)
    step = np.zeros((1, UNKNOWNS.count))
    for k, segment in enumerate(SEGMENTS):
        if segment.hinge is not None:
            step[:, UNKNOWNS.columns(k)] = 1.0
    points = place(poses.moved(step), np.ones(len(LENGTHS)), HEIGHT).points[0]
    assert points[POINT_INDEX["ankle_left"], 0] < -0.2
    assert points[POINT_INDEX["wrist_right"], 0] > 0.15
    assert points[POINT_INDEX["hip_left"], 1] > 0.05 > points[POINT_INDEX["hip_right"], 1]


def test_rotation_vectors_and_matrices_are_each_others_inverse() -> None:
    vectors = np.random.default_rng(5).uniform(-1.5, 1.5, (200, 3))
    matrices = rotation_of(vectors)
    assert matrices @ matrices.swapaxes(-1, -2) == pytest.approx(
        np.broadcast_to(np.eye(3), (200, 3, 3)), abs=1e-12
    )
    assert vector_of(matrices) == pytest.approx(vectors, abs=1e-6)
    assert rotation_of(np.zeros((1, 3)))[0] == pytest.approx(np.eye(3))
