"""A precise capture goes through as it came; a noisy one loses a good part of its noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import angle_between, from_axis_angle, multiply
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.retarget.humanoid.motion import Motion, joint_angles
from kinemimic.train.prediction.coasting import coasted
from kinemimic.train.prediction.live_prediction import GAIN, LivePrediction
from kinemimic.train.prediction.moments import FUTURE, NOISY_PAST
from kinemimic.train.prediction.noise import with_sensor_noise
from kinemimic.train.prediction.predictor import Predictor
from kinemimic.train.reference.reference import Reference
from kinemimic.train.sim.world import CONTROL_RATE

NOW = max(NOISY_PAST) + 1


@pytest.fixture
def walk(motion: Motion) -> tuple[Array, Array]:
    """Six seconds at the control rate."""
    whole = Reference(motion)
    phases = np.arange(6 * CONTROL_RATE) / CONTROL_RATE / motion.duration
    return whole.root(phases), whole.nodes(phases)


def followed(root: Array, rotations: Array, noise: float) -> tuple[Array, Array]:
    """The newest frames that were found, from NOW on."""
    follow = LivePrediction(Predictor.load())
    found = [
        tuple(part[0] for part in follow(root[k - NOW : k], rotations[k - NOW : k], noise, 0.0))
        for k in range(NOW, len(root) + 1)
    ]
    roots, turns = zip(*found, strict=True)
    return np.array(roots), np.array(turns)


def test_a_precise_capture_stays_as_it_is(walk: tuple[Array, Array]) -> None:
    root, rotations = followed(*walk, noise=0.0)
    assert np.array_equal(root, walk[0][NOW - 1 :])
    assert np.array_equal(rotations, walk[1][NOW - 1 :])


def test_noise_is_reduced(walk: tuple[Array, Array]) -> None:
    """A walk through noise of the kind that the networks learned from, four times: errors of knees and hips,
    and of the steps over the ground from the frame before."""
    joints, steps = np.zeros(2), np.zeros(2)
    true, gone = joint_angles(walk[1][NOW - 1 :]), np.diff(walk[0][NOW - 2 :, :2], axis=0)
    for seed in range(4):
        noisy_root, noisy = (
            part[0] for part in with_sensor_noise(walk[0][None], walk[1][None], np.random.default_rng(seed))
        )
        root, rotations = followed(noisy_root, noisy, noise=1.0)
        for k, found in enumerate((noisy[NOW - 1 :], rotations)):
            joints[k] += sum(np.var(curve - true[name]) for name, curve in joint_angles(found).items())
        for k, found in enumerate((noisy_root[NOW - 1 :], root)):
            step = np.linalg.norm(found[:, :2] - noisy_root[NOW - 2 : -1, :2], axis=1)
            steps[k] += np.var(step - np.linalg.norm(gone, axis=1))
    assert joints[1] < 0.7 * joints[0]
    assert steps[1] < 0.7 * steps[0]


@dataclass
class Alternating:
    """Predicts a knee that is bent by 0 or by `bend`, every other time; the body goes 0.1 m a frame."""

    bend: float = 0.4
    calls: int = 0

    def continued(self, root: Array, rotations: Array) -> tuple[Array, Array]:
        return np.repeat(root[-1:], 1 + FUTURE, axis=0), np.repeat(rotations[-1:], 1 + FUTURE, axis=0)

    def denoised(self, root: Array, rotations: Array) -> tuple[Array, Array]:
        turned = np.repeat(rotations[-1:], 1 + FUTURE, axis=0)
        knee = from_axis_angle("Y", np.full(1 + FUTURE, self.bend * (self.calls % 2)))
        turned[:, N["knee_left"]] = multiply(turned[:, N["knee_left"]], knee)
        self.calls += 1
        return root[-2] + np.outer(np.arange(1, 2 + FUTURE), [0.1, 0.0, 0.0]), turned


def test_the_frames_correct_what_was_predicted(walk: tuple[Array, Array]) -> None:
    """By GAIN: of the bends 0, b, 0, b … that are measured, the filter makes those of an exponential mean."""
    model = Alternating()
    follow = LivePrediction(model)  # type: ignore[arg-type]
    root, rotations = np.tile(walk[0][:1], (NOW, 1)), np.tile(walk[1][:1], (NOW, 1, 1))
    expected = 0.0
    for k in range(12):
        found_root, found = follow(root, rotations, 1.0, 0.0)
        expected = (1.0 - GAIN) * expected + GAIN * model.bend * (k % 2)
        bend = angle_between(found[0, N["knee_left"]], rotations[0, N["knee_left"]])
        assert np.isclose(bend, expected, atol=0.02)
        assert np.allclose(np.diff(found_root[:, 0]), 0.1)
        assert np.isclose(found_root[0, 0] - root[-2, 0], 0.1)
    # A precise frame ends it: the next noisy one begins anew.
    follow(root, rotations, 0.0, 0.0)
    model.calls = 1
    assert np.isclose(
        angle_between(follow(root, rotations, 1.0, 0.0)[1][0, N["knee_left"]], rotations[0, N["knee_left"]]),
        model.bend,
    )


def test_on_the_spot_it_comes_to_rest(walk: tuple[Array, Array]) -> None:
    """Whatever the noise, and halfway between both in the fade."""
    follow = LivePrediction(Predictor.load())
    root, rotations = walk[0][:NOW], walk[1][:NOW]
    going, rests = follow(root, rotations, 0.0, 0.0), coasted(root, rotations, FUTURE)
    assert np.abs(going[0][-1] - rests[0][-1]).max() > 0.1
    for noise in (0.0, 1.0):
        found = follow(root, rotations, noise, 1.0)
        np.testing.assert_array_equal(found[0], rests[0])
        np.testing.assert_array_equal(found[1], rests[1])
    half = follow(root, rotations, 0.0, 0.5)
    np.testing.assert_allclose(half[0], 0.5 * (going[0] + rests[0]), atol=1e-12)
    np.testing.assert_allclose(
        angle_between(half[1], going[1]), 0.5 * angle_between(going[1], rests[1]), atol=0.02
    )
