"""Eq. 1-5 against numbers worked out by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from kinemimic.pipeline.rotations import from_axis_angle, multiply
from kinemimic.retarget.body import BODY_INDEX
from kinemimic.train.config import POSE_WEIGHTS, PRESETS, RewardConfig
from kinemimic.train.reference import Reference
from kinemimic.train.reward import errors, rewards
from kinemimic.train.world import BodyStates

ROWS = np.array([0.25])


@pytest.fixture
def bodies(motion) -> BodyStates:
    return Reference(motion).bodies(ROWS)


@pytest.mark.parametrize("name", ["default", "paper"])
def test_perfect_imitation_earns_the_sum_of_the_weights(bodies: BodyStates, name: str) -> None:
    config = PRESETS[name].env.reward
    assert rewards(bodies, bodies, config).sum() == pytest.approx(sum(config.weights.values()), abs=1e-6)
    assert sum(config.weights.values()) == pytest.approx(1.0)


def test_scales_tighten_between_two_numbers_of_samples() -> None:
    config = replace(PRESETS["default"], tighten={"pose": 24.0}, tighten_samples=(100, 300))
    assert [config.reward(n).scales["pose"] for n in (0, 100, 150, 300, 900)] == [8.0, 8.0, 12.0, 24.0, 24.0]
    assert config.reward(900).scales["height"] == config.env.reward.scales["height"]


def test_pose_weights_sum_to_one() -> None:
    assert sum(POSE_WEIGHTS.values()) == pytest.approx(1.0)


def test_height_term_by_hand(bodies: BodyStates) -> None:
    lifted = replace(bodies, positions=bodies.positions + np.array([0, 0, 0.1]))
    squares = RewardConfig(weights={"height": 2.0}, scales={"height": 40.0})
    assert rewards(lifted, bodies, squares)[0, 0] == pytest.approx(2 * np.exp(-40 * 0.01))
    norm = RewardConfig(form="norm", weights={"height": 2.0}, scales={"height": 10.0})
    assert rewards(lifted, bodies, norm)[0, 0] == pytest.approx(2 * np.exp(-1.0))


def test_pose_error_by_hand(bodies: BodyStates) -> None:
    """A hand turned by 0.3 rad moves one joint: w 0.3² as squares, 0.3 as a norm."""
    rotations = bodies.rotations.copy()
    hand = BODY_INDEX["hand_left"]
    rotations[:, hand] = multiply(rotations[:, hand], from_axis_angle("X", np.array([0.3])))
    turned = replace(bodies, rotations=rotations)
    assert errors(turned, bodies, RewardConfig())["pose"][0] == pytest.approx(
        POSE_WEIGHTS["hand_left"] * 0.09, rel=1e-6
    )
    assert errors(turned, bodies, PRESETS["paper"].env.reward)["pose"][0] == pytest.approx(0.3, rel=1e-6)


def test_velocity_terms_by_hand(bodies: BodyStates) -> None:
    """Every body 0.2 m/s too fast: mean of squares 0.04; the norm over 15 bodies 0.2 √15."""
    fast = replace(bodies, linear=bodies.linear + np.array([0.2, 0, 0]))
    assert errors(fast, bodies, RewardConfig())["linear"][0] == pytest.approx(0.04)
    assert errors(fast, bodies, PRESETS["paper"].env.reward)["linear"][0] == pytest.approx(0.2 * np.sqrt(15))
