from __future__ import annotations

import numpy as np
import pytest

from kinemimic.pipeline.kinematics.rotations import rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.retarget.feet.contact import sole_positions
from kinemimic.retarget.humanoid.body import BODIES, BODY_NODES, STANDING_HEIGHT, TOTAL_MASS
from kinemimic.retarget.humanoid.limits import LIMITS, TOLERANCE, swing_twist
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.library.exercises import MAX_DEPTH, MAX_SPEED, SECONDS, exercise


@pytest.fixture(scope="module")
def made() -> list[Motion]:
    return [exercise(0, number) for number in range(25)]


def centre_of_mass(motion: Motion) -> np.ndarray:
    """(T, 3), from Table 1's masses."""
    nodes, frames = motion.kinematics()
    masses = np.array([body.mass for body in BODIES])
    centers = np.array([body.center for body in BODIES])
    world = frames[:, BODY_NODES]
    places = nodes[:, BODY_NODES] + rotate(world, np.broadcast_to(centers, (len(world), 15, 3)))
    return np.asarray(np.einsum("b,tbi->ti", masses, places) / TOTAL_MASS)


def test_the_same_seed_and_number_give_the_same_exercise(made: list[Motion]) -> None:
    assert exercise(0, 3).identity == made[3].identity
    assert exercise(1, 3).identity != made[3].identity
    assert len({one.identity for one in made}) == len(made)


def test_standing_feet_stay_and_nothing_is_below_the_ground(made: list[Motion]) -> None:
    for one in made:
        soles = sole_positions(*one.kinematics())
        assert soles[..., 2].min() >= -MAX_DEPTH
        assert np.abs(soles[..., 2][one.contacts]).max() <= MAX_DEPTH
        still = one.contacts[1:] & one.contacts[:-1]
        assert np.linalg.norm(np.diff(soles, axis=0), axis=-1).max(axis=-1)[still].max() < 0.002
        assert one.contacts.any(axis=1).all()


def test_the_centre_of_mass_is_over_the_feet_that_stand(made: list[Motion]) -> None:
    """Static balance: in the rectangle around the soles of the standing feet, with 3 cm of tolerance."""
    for one in made:
        centre = centre_of_mass(one)[:, :2]
        soles = sole_positions(*one.kinematics())[..., :2]
        least = np.where(one.contacts[..., None, None], soles, np.inf).min(axis=(1, 2))
        most = np.where(one.contacts[..., None, None], soles, -np.inf).max(axis=(1, 2))
        assert (centre >= least - 0.03).all()
        assert (centre <= most + 0.03).all()


def test_joints_stay_within_their_limits_and_the_hips_are_calm(made: list[Motion]) -> None:
    for one in made:
        for joint, box in LIMITS.items():
            angles = swing_twist(one.rotations[:, NODE_INDEX[joint]])
            assert (angles >= box[:, 0] - TOLERANCE).all(), joint
            assert (angles <= box[:, 1] + TOLERANCE).all(), joint
        assert np.linalg.norm(np.diff(one.root, axis=0), axis=-1).max() * one.rate <= MAX_SPEED
        assert SECONDS[0] - 0.1 <= one.duration <= SECONDS[1]
        assert one.root[0].tolist()[:2] == [0.0, 0.0]


def test_exercises_squat_step_and_reach(made: list[Motion]) -> None:
    assert min(one.root[:, 2].min() for one in made) < STANDING_HEIGHT - 0.2
    assert any(not one.contacts.all() for one in made)
    assert any(one.contacts.all() for one in made)
    highest = [one.kinematics()[0][:, NODE_INDEX["wrist_left"], 2].max() for one in made]
    assert max(highest) > STANDING_HEIGHT + 0.5 > min(highest)
