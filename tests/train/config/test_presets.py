"""Presets: stored and restored unchanged, and consistent with each other and with the world's limits."""

from __future__ import annotations

import json

import pytest

from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.env_config import POSE_WEIGHTS
from kinemimic.train.config.presets import PRESETS
from kinemimic.train.sim.world import FRICTION, MIN_MASS


@pytest.mark.parametrize("name", PRESETS)
def test_a_stored_preset_is_read_back_as_it_was(name: str) -> None:
    config = PRESETS[name]
    assert config.preset == name
    assert TrainConfig.from_json(json.loads(json.dumps(config.to_json()))) == config


def test_weights_of_pose_and_reward_sum_to_one() -> None:
    assert sum(POSE_WEIGHTS.values()) == pytest.approx(1.0)
    rewards = {name: dict(config.env.reward.weights) for name, config in PRESETS.items()}
    # The path of `robust` weighs more on top of the rest; a return is told as a share of the largest.
    assert rewards["robust"].pop("path") == pytest.approx(3 * rewards["default"]["path"])
    assert rewards.pop("robust").items() < rewards["default"].items()
    for weights in rewards.values():
        assert sum(weights.values()) == pytest.approx(1.0)


@pytest.mark.parametrize("name", PRESETS)
def test_domain_randomization_is_within_the_worlds_limits(name: str) -> None:
    hard = PRESETS[name].env.domain_randomization
    for low, high in (hard.push, hard.rest, hard.friction, hard.mass, hard.delay):
        assert 0.0 <= low <= high
    assert hard.mass[0] >= MIN_MASS
    assert hard.friction[0] <= FRICTION <= hard.friction[1]
