"""Irregular gaits: how far their joints are from the loop's, and that they stay a gait on the ground."""

from __future__ import annotations

import numpy as np
import pytest
from peers.trackers import shipped_motion

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import continuous
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.retarget.feet.scale import body_kinematics
from kinemimic.retarget.humanoid.limits import LIMITS, clamp_to_limits
from kinemimic.retarget.humanoid.motion import Motion, joint_angles
from kinemimic.retarget.humanoid.surface import lowest_points
from kinemimic.retarget.library import irregular as module
from kinemimic.retarget.library.irregular import JOINTS, SECONDS, irregular


@pytest.fixture(scope="module")
def loop() -> Motion:
    return shipped_motion("walk")


def knee_differences(one: Motion, loop: Motion) -> Array:
    """rms of the knee's difference from the loop at the best phase of each of its strides, rad."""
    knee, cycle = (joint_angles(each.rotations)["knee_left"] for each in (one, loop))
    size = len(cycle)
    strides = knee[: len(knee) // size * size].reshape(-1, size)
    shifted = np.array([np.roll(cycle, k) for k in range(size)])
    return np.sqrt(((strides[:, None] - shifted) ** 2).mean(axis=-1)).min(axis=1)


def test_without_noise_it_is_the_loop(loop: Motion, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "STRENGTH", (0.0, 0.0))
    monkeypatch.setattr(module, "JITTER", (0.0, 0.0))
    one = irregular(loop, np.random.default_rng(0))
    assert not one.cyclic
    assert SECONDS[0] - 0.1 < one.duration < SECONDS[1]
    assert knee_differences(one, loop).max() < np.radians(2.0)
    assert continuous(one.rotations) == pytest.approx(one.rotations)


def test_its_strides_differ_as_much_as_is_drawn(loop: Motion, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "STRENGTH", (1.0, 1.0))
    monkeypatch.setattr(module, "JITTER", (0.0, 0.0))
    found = np.concatenate(
        [knee_differences(irregular(loop, np.random.default_rng(k)), loop) for k in range(6)]
    )
    wanted = JOINTS["knee"][1]
    assert 0.5 * wanted < found.mean() < 2.0 * wanted
    assert np.ptp(found) > 0.3 * wanted


def test_it_stays_a_gait_on_the_ground(loop: Motion) -> None:
    for seed in range(4):
        one = irregular(loop, np.random.default_rng(seed))
        way = one.root[-1, 0] - one.root[0, 0]
        assert way / one.duration == pytest.approx(loop.cycle_offset[0] / loop.duration, rel=0.25)
        positions, frames = body_kinematics(one.rotations, one.root)
        assert lowest_points(positions, frames)[..., 2].min() > -0.05
        for joint in LIMITS:
            node = one.rotations[:, NODE_INDEX[joint]]
            assert np.abs(np.sum(node * clamp_to_limits(joint, node), axis=-1)).min() > 0.995


def test_the_same_draw_gives_the_same_motion(loop: Motion) -> None:
    first, again, other = (irregular(loop, np.random.default_rng(seed)) for seed in (1, 1, 2))
    assert np.array_equal(first.rotations, again.rotations)
    assert len(first.root) != len(other.root) or not np.array_equal(first.rotations, other.rotations)
