"""Noise of a sensor has the strength that it says, is smooth, and keeps what no sensor shows."""

from __future__ import annotations

import numpy as np
import pytest

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import IDENTITY, angle_between, to_rotvec
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.train.prediction import noise
from kinemimic.train.prediction.noise import with_sensor_noise

COUNT, FRAMES = 400, 43


@pytest.fixture(scope="module")
def standing() -> tuple[Array, Array]:
    rotations = np.tile(IDENTITY, (COUNT, FRAMES, 20, 1))
    return np.tile([3.0, -1.0, 0.9], (COUNT, FRAMES, 1)), rotations


@pytest.fixture(scope="module")
def noisy(standing: tuple[Array, Array]) -> tuple[Array, Array]:
    return with_sensor_noise(*standing, np.random.default_rng(0))


def test_joints_are_off_by_what_is_said(noisy: tuple[Array, Array]) -> None:
    """Of hips about Y: wandering of strength s, and an offset of min(s, 1)."""
    error = to_rotvec(noisy[1][:, :, N["hip_left"]])[..., 1]
    strength = np.linspace(*noise.STRENGTH, 1001)
    wanders, stays = noise.WANDERS["hip"][1], noise.STAYS["hip"][1]
    expected = np.sqrt(np.mean((strength * wanders) ** 2 + (np.minimum(strength, 1.0) * stays) ** 2))
    assert np.isclose(np.degrees(np.sqrt(np.mean(error**2))), expected, rtol=0.1)
    # Neighbouring frames differ much less than frames far apart do.
    near, far = np.diff(error, axis=1), error[:, 20:] - error[:, :-20]
    assert np.std(near) < 0.4 * np.std(far)


def test_knees_bend_forward_alone(noisy: tuple[Array, Array]) -> None:
    bend = to_rotvec(noisy[1][:, :, [N["knee_left"], N["knee_right"]]])[..., 1]
    assert bend.min() >= 0.0
    assert np.degrees(bend.max()) > 10.0


def test_a_share_of_the_trunks_is_neutral(noisy: tuple[Array, Array]) -> None:
    still = angle_between(noisy[1][:, 1:, N["spine"]], noisy[1][:, :-1, N["spine"]]).max(axis=1) < 1e-9
    assert np.isclose(np.mean(still), noise.NEUTRAL, atol=0.1)


def test_the_path_wanders_and_the_height_hardly(
    standing: tuple[Array, Array], noisy: tuple[Array, Array]
) -> None:
    gone = noisy[0] - standing[0]
    assert 0.1 < np.std(gone[:, -1, 0]) < 1.0
    assert np.std(gone[..., 1]) < np.std(gone[..., 0])
    assert np.abs(gone[..., 2]).max() < 0.1


def test_it_is_drawn_by_the_generator(standing: tuple[Array, Array], noisy: tuple[Array, Array]) -> None:
    again = with_sensor_noise(*standing, np.random.default_rng(0))
    assert np.array_equal(again[0], noisy[0]) and np.array_equal(again[1], noisy[1])
    other = with_sensor_noise(*standing, np.random.default_rng(1))
    assert not np.allclose(other[1], noisy[1])
