"""Settings: what is stored is what was meant, and what grows in a training does so as it says."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.train.config import POSE_WEIGHTS, PRESETS, TrainConfig, preset
from kinemimic.train.world import FRICTION, LIGHTEST


@pytest.mark.parametrize("name", PRESETS)
def test_a_stored_preset_is_read_back_as_it_was(name: str) -> None:
    config = PRESETS[name]
    assert config.preset == name
    assert TrainConfig.from_json(json.loads(json.dumps(config.to_json()))) == config


def test_what_does_not_fit_is_refused_by_name() -> None:
    value = PRESETS["default"].to_json()
    with pytest.raises(KinemimicError, match="surprise"):
        TrainConfig.from_json({**value, "env": {**value["env"], "surprise": 1}})
    del value["env"]["preview"]
    with pytest.raises(KinemimicError, match="preview"):
        TrainConfig.from_json(value)
    with pytest.raises(KinemimicError, match="default, robust, paper"):
        preset("none")


def test_weights_of_pose_and_reward_sum_to_one() -> None:
    assert sum(POSE_WEIGHTS.values()) == pytest.approx(1.0)
    for config in PRESETS.values():
        assert sum(config.env.reward.weights.values()) == pytest.approx(1.0)


def test_scales_and_hardships_grow_between_their_numbers_of_samples() -> None:
    config = replace(
        TrainConfig(), tighten={"pose": 32.0}, tighten_samples=(100, 200), harden_samples=(1000, 3000)
    )
    first = config.env.reward.scales["pose"]
    assert [config.reward(n).scales["pose"] for n in (0, 100, 150, 200, 900)] == pytest.approx(
        [first, first, 0.5 * (first + 32.0), 32.0, 32.0]
    )
    assert config.reward(900).scales["height"] == config.env.reward.scales["height"]
    assert [config.strength(n) for n in (0, 1000, 1500, 3000, 9000)] == [0.0, 0.0, 0.25, 1.0, 1.0]


@pytest.mark.parametrize("name", PRESETS)
def test_hardships_are_such_as_the_world_can_bear(name: str) -> None:
    hard = PRESETS[name].env.hardships
    for low, high in (hard.push, hard.rest, hard.friction, hard.mass, hard.delay):
        assert 0.0 <= low <= high
    assert hard.mass[0] >= LIGHTEST
    assert hard.friction[0] <= FRICTION <= hard.friction[1]
