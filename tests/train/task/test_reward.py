"""Eq. 1-5 against values computed by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.kinematics.rotations import angle_between, from_axis_angle, from_rotvec, multiply
from kinemimic.retarget.humanoid.body import BODY_INDEX
from kinemimic.train.config.env_config import POSE_WEIGHTS, RewardConfig
from kinemimic.train.config.presets import PRESETS
from kinemimic.train.reference.reference import Reference
from kinemimic.train.sim.world import BodyStates
from kinemimic.train.task.reward import errors, pose, pose_turns, rewards

ROWS = np.array([0.25])


@pytest.fixture
def bodies(motion) -> BodyStates:
    return Reference(motion).bodies(ROWS)


def error(sim: BodyStates, ref: BodyStates, config: RewardConfig, name: str) -> float:
    return errors(sim, ref, pose_turns(sim, ref)[0], config)[name][0]


def earned(sim: BodyStates, ref: BodyStates, config: RewardConfig) -> np.ndarray:
    return rewards(sim, ref, pose_turns(sim, ref)[0], config)


def test_a_pose_is_the_pelvis_in_the_world_and_the_joints(bodies: BodyStates) -> None:
    found = pose(bodies.rotations)
    np.testing.assert_array_equal(found[:, 0], bodies.rotations[:, 0])
    np.testing.assert_array_equal(found[:, 1:], bodies.joints)


def test_turns_lead_from_the_simulated_pose_to_each_reference(motion) -> None:
    reference = Reference(motion)
    sim, *refs = (reference.bodies(np.array([0.1, 0.6]) + shift) for shift in (0.0, 0.1, 0.3))
    turns = pose_turns(sim, *refs)
    for turn, ref in zip(turns, refs, strict=True):
        led = multiply(pose(sim.rotations), from_rotvec(turn))
        assert angle_between(led, pose(ref.rotations)).max() < 1e-7


@pytest.mark.parametrize("name", ["default", "paper"])
def test_perfect_imitation_earns_the_sum_of_the_weights(bodies: BodyStates, name: str) -> None:
    config = PRESETS[name].env.reward
    assert earned(bodies, bodies, config).sum() == pytest.approx(sum(config.weights.values()), abs=1e-6)


def test_height_term_by_hand(bodies: BodyStates) -> None:
    lifted = replace(bodies, positions=bodies.positions + np.array([0, 0, 0.1]))
    squares = RewardConfig(weights={"height": 2.0}, scales={"height": 40.0})
    assert earned(lifted, bodies, squares)[0, 0] == pytest.approx(2 * np.exp(-40 * 0.01))
    norm = RewardConfig(form="norm", weights={"height": 2.0}, scales={"height": 10.0})
    assert earned(lifted, bodies, norm)[0, 0] == pytest.approx(2 * np.exp(-1.0))


def test_pose_error_by_hand(bodies: BodyStates) -> None:
    """A hand turned by 0.3 rad moves one joint: w 0.3² as squares, 0.3 as a norm."""
    rotations = bodies.rotations.copy()
    hand = BODY_INDEX["hand_left"]
    rotations[:, hand] = multiply(rotations[:, hand], from_axis_angle("X", np.array([0.3])))
    turned = replace(bodies, rotations=rotations)
    paper = PRESETS["paper"].env.reward
    assert error(turned, bodies, RewardConfig(), "pose") == pytest.approx(
        POSE_WEIGHTS["hand_left"] * 0.09, rel=1e-6
    )
    assert error(turned, bodies, paper, "pose") == pytest.approx(0.3, rel=1e-6)


def test_velocity_terms_by_hand(bodies: BodyStates) -> None:
    """Every body 0.2 m/s too fast: mean of squares 0.04; the norm over 15 bodies 0.2 √15."""
    fast = replace(bodies, linear=bodies.linear + np.array([0.2, 0, 0]))
    paper = PRESETS["paper"].env.reward
    assert error(fast, bodies, RewardConfig(), "linear") == pytest.approx(0.04)
    assert error(fast, bodies, paper, "linear") == pytest.approx(0.2 * np.sqrt(15))


def test_path_error_by_hand(bodies: BodyStates) -> None:
    """Every body 3 cm ahead and 4 cm beside its reference: 5 cm off the path, and no other error."""
    aside = replace(bodies, positions=bodies.positions + np.array([0.03, 0.04, 0.0]))
    assert error(aside, bodies, RewardConfig(), "path") == pytest.approx(0.05**2)
    for name in ("pose", "linear", "angular", "height"):
        assert error(aside, bodies, RewardConfig(), name) == pytest.approx(0.0, abs=1e-12)


def test_a_weight_of_an_unknown_term_is_named(bodies: BodyStates) -> None:
    config = RewardConfig(weights={"pose": 0.5, "poise": 0.5}, scales={"pose": 1.0, "poise": 1.0})
    with pytest.raises(KinemimicError, match="expected pose, linear, angular, height, path, found poise"):
        earned(bodies, bodies, config)
