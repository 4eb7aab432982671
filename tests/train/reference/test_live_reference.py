"""A reference that grows, and whose next frames are foreseen without error, against the motion as a whole."""

from __future__ import annotations

import numpy as np
import pytest

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import angle_between
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.reference.live_reference import AHEAD, KNOWN, MEMORY, LiveReference, Predict
from kinemimic.train.reference.reference import Reference
from kinemimic.train.sim.world import CONTROL_RATE


@pytest.fixture
def once(motion: Motion) -> Motion:
    """Three seconds of a stride that is repeated, as frames of the control rate."""
    whole, count = Reference(motion), 3 * CONTROL_RATE
    phases = np.arange(count) / CONTROL_RATE / motion.duration
    return Motion(
        CONTROL_RATE, whole.root(phases), whole.nodes(phases), np.zeros((count, 2), dtype=bool), cyclic=False
    )


def foreseen(once: Motion) -> Predict:
    """The newest frame and those that come."""
    came = -1

    def predict(roots: Array, turns: Array, noise: float, on_the_spot: float) -> tuple[Array, Array]:
        nonlocal came
        assert noise == 0.0
        assert on_the_spot == float(came < 0)  # before the first frame, it stands
        assert roots.shape == (MEMORY, 3) and turns.shape == (MEMORY, 20, 4)
        came += 1
        coming = np.clip(np.arange(came - 1, came + AHEAD - KNOWN), 0, len(once.root) - 1)
        return once.root[coming], once.rotations[coming]

    return predict


def still(roots: Array, turns: Array, noise: float, on_the_spot: float) -> tuple[Array, Array]:
    """The last frame goes on."""
    count = 1 + AHEAD - KNOWN
    return np.repeat(roots[-1:], count, axis=0), np.repeat(turns[-1:], count, axis=0)


def test_it_is_the_whole_motion_as_far_as_it_has_come(once: Motion) -> None:
    whole, live = Reference(once), LiveReference(once.root[0], once.rotations[0], foreseen(once))
    for k in range(len(once.root)):
        live.append(once.root[k], once.rotations[k])
        # Frame k of the motion is number KNOWN + 1 + k: before it, the reference stood.
        if not 40 <= k < len(once.root) - AHEAD:
            continue
        at = live.present + np.arange(0.0, AHEAD + 1.0, 4.0) / CONTROL_RATE
        expected = whole.bodies((at - (KNOWN + 1) / CONTROL_RATE) / once.duration)
        found = live.bodies(at)
        assert np.abs(found.positions - expected.positions).max() < 2e-3
        assert angle_between(found.rotations, expected.rotations).max() < 5e-3
        # Velocities are read at the present alone.
        assert np.abs(found.linear[0] - expected.linear[0]).max() < 0.05


def test_feed_forward_targets_lead_as_the_whole_motions(once: Motion) -> None:
    whole, live = Reference(once), LiveReference(once.root[0], once.rotations[0], foreseen(once))
    for k in range(50):
        live.append(once.root[k], once.rotations[k])
    at = live.present + np.arange(1.0, 9.0) / (8 * CONTROL_RATE)
    found, _ = live.targets(at)
    expected, _ = whole.targets((at - (KNOWN + 1) / CONTROL_RATE) / once.duration)
    plain, _ = live.joints(at)
    led = angle_between(expected, plain)
    assert led.max() > 0.02
    assert angle_between(found, expected).max() < 0.3 * led.max()


def test_a_new_one_stands(once: Motion) -> None:
    live = LiveReference(once.root[0], once.rotations[0], still)
    poses = live.poses(np.array([live.present]))
    assert np.allclose(poses.root, once.root[0])
    assert np.abs(poses.root_linear).max() < 1e-9


def test_without_noise_the_path_goes_on_from_where_it_was(once: Motion) -> None:
    """While the capture is noisy, the steps of the prediction count, here without those to the side; when
    noise comes or goes, nothing jumps."""

    def straight(roots: Array, turns: Array, noise: float, on_the_spot: float) -> tuple[Array, Array]:
        root, rotations = still(roots, turns, noise, on_the_spot)
        root[:, 1] -= noise * (roots[-1, 1] - roots[-2, 1])
        return root, rotations

    live = LiveReference(once.root[0], once.rotations[0], straight)
    way = [[0.0, 0.0, 0.0]]
    for k in range(60):
        root = once.root[0] + [0.03 * k, 0.02 * k, 0.0]
        live.append(root, once.rotations[0], noise=float(20 <= k < 40))
        way.append((live.root(np.array([live.present]))[0] - once.root[0]).tolist())
    steps = np.diff(way, axis=0)[5:]
    assert np.allclose(steps[:, 0], 0.03, atol=1e-9)
    # The present is KNOWN frames behind the newest.
    aside = np.full(60, 0.02)
    aside[20 + KNOWN : 40 + KNOWN] = 0.0
    assert np.allclose(steps[:, 1], aside[5:], atol=1e-9)
