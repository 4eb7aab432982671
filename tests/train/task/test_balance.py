"""Balance on standing feet: laws of what it measures, and a humanoid that falls without it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from kinemimic.pipeline.kinematics.rotations import from_axis_angle, multiply, rotate
from kinemimic.retarget.humanoid.body import BODY_INDEX, FEET
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.library.exercises import exercise
from kinemimic.train.config.env_config import EnvConfig
from kinemimic.train.reference.reference import Reference
from kinemimic.train.sim.engines import open_world, resolve
from kinemimic.train.sim.world import BodyStates
from kinemimic.train.task.balance import balance_turns, off_balance, standing_feet
from kinemimic.train.task.env import ACTIONS, ImitationBatch

ANKLES = [foot - 1 for foot in FEET]
HIPS = [BODY_INDEX["thigh_left"] - 1, BODY_INDEX["thigh_right"] - 1]


@pytest.fixture
def bodies() -> BodyStates:
    """Three instants of an exercise on the spot."""
    return Reference(exercise(0, 4)).bodies(np.array([0.0, 0.4, 0.8]))


def moved(bodies: BodyStates, turn: float, shift: tuple[float, float, float]) -> BodyStates:
    q = from_axis_angle("Z", np.array(turn))
    return BodyStates(
        rotate(q, bodies.positions) + shift,
        multiply(np.broadcast_to(q, bodies.rotations.shape), bodies.rotations),
        rotate(q, bodies.linear),
        rotate(q, bodies.angular),
    )


def shifted(bodies: BodyStates, shift: tuple[float, float, float]) -> BodyStates:
    """The bodies but for the feet moved, along the heading of a figure that looks along X."""
    positions = bodies.positions.copy()
    others = [k for k in range(positions.shape[1]) if k not in FEET]
    positions[:, others] += shift
    return replace(bodies, positions=positions)


def test_it_does_not_depend_on_place_and_heading(bodies: BodyStates) -> None:
    elsewhere = moved(bodies, 2.0, (3.0, -1.0, 0.0))
    np.testing.assert_allclose(off_balance(elsewhere), off_balance(bodies), atol=1e-9)
    np.testing.assert_allclose(balance_turns(elsewhere), balance_turns(bodies), atol=1e-7)


def test_the_point_moves_with_the_body_and_ahead_of_its_velocity(bodies: BodyStates) -> None:
    """By hand: all but the feet, 2.4 of 48.2 kg, are moved; 1 m/s counts for sqrt(h / g) seconds."""
    ahead = rotate(bodies.rotations[:, 0], np.array([1.0, 0.0, 0.0]))[:, :2]
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    before = off_balance(bodies)
    change = off_balance(shifted(bodies, (0.05, 0.02, 0.0))) - before
    left = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
    expected = np.stack([ahead @ [0.05, 0.02], left @ [0.05, 0.02]], axis=1) * (48.2 - 2.4) / 48.2
    np.testing.assert_allclose(change, expected, atol=1e-9)
    faster = replace(bodies, linear=bodies.linear + np.array([0.1, 0.0, 0.0]))
    gained = np.linalg.norm(off_balance(faster) - before, axis=1)
    assert ((0.1 * np.sqrt(0.5 / 9.81) < gained) & (gained < 0.1 * np.sqrt(1.1 / 9.81))).all()


def test_a_foot_in_the_air_does_not_carry(bodies: BodyStates) -> None:
    assert standing_feet(bodies).tolist() == [[1.0, 1.0]] * 3
    positions = bodies.positions.copy()
    positions[1, FEET[0], 2] += 0.1
    raised = replace(bodies, positions=positions)
    assert standing_feet(raised).tolist() == [[1.0, 1.0], [0.0, 1.0], [1.0, 1.0]]
    turns = balance_turns(bodies, raised)
    assert (turns[1, [ANKLES[0], HIPS[0]]] == 0.0).all()
    assert (turns[1, ANKLES[1]] != 0.0).any()


def test_the_sway_of_the_reference_is_followed_but_not_to_the_foot() -> None:
    """On its reference, a humanoid with both feet on the ground is not pushed back from where that stands;
    beyond the followed part, it is."""
    state = Reference(exercise(0, 4)).bodies(np.array([0.0]))
    still = replace(state, linear=np.zeros_like(state.linear))
    between = np.linalg.norm((still.positions[0, FEET[0]] - still.positions[0, FEET[1]])[:2])
    left = rotate(still.rotations[0, 0], np.array([0.0, 1.0, 0.0]))
    centred = -off_balance(still)[0, 1]
    for share, pushed in ((0.3, False), (-0.3, False), (1.0, True), (-1.0, True)):
        way = (centred + share * 0.5 * between) * 48.2 / 45.8
        leaning = shifted(still, tuple(way * left))
        turns = balance_turns(leaning, leaning)[0, ANKLES, 0]
        assert (np.abs(turns) > 1e-3).all() == pushed, share
        if pushed:
            assert (np.sign(turns) == -np.sign(share)).all()


def standing(seconds: float) -> Motion:
    """An exercise's first pose, held."""
    one = exercise(0, 6)
    count = round(seconds * one.rate)
    hold = [0] * count
    return replace(
        one, root=one.root[hold], rotations=one.rotations[hold], contacts=one.contacts[hold], provenance={}
    )


@pytest.mark.parametrize(("balance", "stands"), [(True, True), (False, False)])
def test_a_humanoid_without_a_policy_stands_with_it_and_falls_without(balance: bool, stands: bool) -> None:
    config = EnvConfig(balance=balance, mirror=False)
    batch = ImitationBatch(open_world(1, resolve("auto")), Reference(standing(6.0)), config)
    batch.reset(np.array([0]), np.array([0.0]))
    for _ in range(150):
        batch.step(np.zeros((1, ACTIONS)))
    assert batch.fallen()[0] == (not stands)
    if stands:
        assert np.abs(off_balance(batch.bodies)[0]).max() < 0.1
