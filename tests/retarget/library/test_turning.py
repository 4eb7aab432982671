from __future__ import annotations

import numpy as np
import pytest
from peers.trackers import shipped_motion

from kinemimic.pipeline.kinematics.rotations import angle_between, conjugate, multiply, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.library.turning import RATE, SECONDS, turning


@pytest.fixture(scope="module")
def loop() -> Motion:
    return shipped_motion("walk")


def test_a_turning_gait_faces_where_it_goes(loop: Motion) -> None:
    one = turning(loop, np.random.default_rng(2))
    assert not one.cyclic
    assert SECONDS[0] - 0.1 < one.duration < SECONDS[1]
    ahead = rotate(one.rotations[:, 0], np.broadcast_to([1.0, 0.0, 0.0], (len(one.root), 3)))
    facing = np.unwrap(np.arctan2(ahead[:, 1], ahead[:, 0]))
    period = len(loop.root)
    # The mean heading of a stride against the direction of its step.
    step = one.root[period:] - one.root[:-period]
    direction = np.unwrap(np.arctan2(step[:, 1], step[:, 0]))
    mean = np.convolve(facing, np.full(period, 1.0 / period), mode="valid")[: len(direction)]
    assert np.ptp(facing) > 0.3
    assert np.abs(mean - direction).max() < 0.15
    speed = np.abs(np.diff(facing)).max() * one.rate
    assert speed < 2.0 * RATE + np.abs(np.diff(_facing(loop))).max() * loop.rate


def test_turning_keeps_the_joints_of_the_loop(loop: Motion) -> None:
    one = turning(loop, np.random.default_rng(2))
    knee = NODE_INDEX["knee_right"]
    cycle = np.concatenate([loop.rotations[:, knee]] * 8)
    differences = [
        angle_between(one.rotations[:, knee], cycle[first : first + len(one.root)]).mean()
        for first in range(len(loop.root))
    ]
    assert min(differences) < np.radians(3.0)
    upright = rotate(one.rotations[:, 0], np.broadcast_to([0.0, 0.0, 1.0], (len(one.root), 3)))[:, 2]
    level = rotate(loop.rotations[:, 0], np.broadcast_to([0.0, 0.0, 1.0], (len(loop.root), 3)))[:, 2]
    assert upright.min() > level.min() - 0.02


def _facing(motion: Motion) -> np.ndarray:
    turns = multiply(conjugate(motion.rotations[:1, 0]), motion.rotations[:, 0])
    ahead = rotate(turns, np.broadcast_to([1.0, 0.0, 0.0], (len(motion.root), 3)))
    return np.unwrap(np.arctan2(ahead[:, 1], ahead[:, 0]))
