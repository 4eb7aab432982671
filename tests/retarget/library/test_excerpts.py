from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from kinemimic.pipeline.files.data_folder import DATASETS
from kinemimic.pipeline.kinematics.rotations import angle_between, conjugate, multiply, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.retarget.formats.motion_json import read_motion_json
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.library.excerpts import PACE, RATE, SECONDS, excerpt, turning


@pytest.fixture(scope="module")
def loop() -> Motion:
    return read_motion_json(DATASETS / "policies/walk/motion.json")


@pytest.fixture(scope="module")
def once(loop: Motion) -> Motion:
    """Six strides, kept as recorded."""
    laps = range(6)
    return replace(
        loop,
        root=np.concatenate([loop.root + lap * loop.cycle_offset for lap in laps]),
        rotations=np.concatenate([loop.rotations] * 6),
        contacts=np.concatenate([loop.contacts] * 6),
        cyclic=False,
        cycle_offset=np.zeros(3),
    )


def test_an_excerpt_has_the_legs_of_its_recording_and_other_arms(once: Motion) -> None:
    made = [excerpt([once], 0, number) for number in range(4)]
    assert excerpt([once], 0, 1).identity == made[1].identity
    assert len({one.identity for one in made}) == 4
    frames = len(once.root) // 6
    for one in made:
        assert not one.cyclic
        assert SECONDS[0] - 0.1 < one.duration < SECONDS[1] + 0.1
        assert PACE[0] <= one.rate / once.rate <= PACE[1]
        knees = one.rotations[:, NODE_INDEX["knee_left"]]
        turns = [
            angle_between(knees, once.rotations[first : first + len(knees), NODE_INDEX["knee_left"]]).max()
            for first in range(frames)
        ]
        assert min(turns) < np.radians(6.0)
        elbows = [one.rotations[:, NODE_INDEX["elbow_left"]].mean(axis=0) for one in made]
    assert np.ptp(elbows, axis=0).max() > 0.02


def test_without_a_recording_there_is_no_excerpt() -> None:
    with pytest.raises(ValueError, match="no motions that are kept as recorded"):
        excerpt([], 0, 0)


def test_a_turning_gait_faces_where_it_goes(loop: Motion) -> None:
    one = turning(loop, np.random.default_rng(2))
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
