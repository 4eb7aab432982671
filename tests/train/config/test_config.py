"""Settings: stored and restored unchanged, checked, and scheduled correctly."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.train.config.config import POSE_WEIGHTS, PRESETS, TrainConfig, preset, scheduled_at
from kinemimic.train.sim.world import FRICTION, MIN_MASS


@pytest.mark.parametrize("name", PRESETS)
def test_a_stored_preset_is_read_back_as_it_was(name: str) -> None:
    config = PRESETS[name]
    assert config.preset == name
    assert TrainConfig.from_json(json.loads(json.dumps(config.to_json()))) == config


def test_invalid_values_are_named() -> None:
    value = PRESETS["default"].to_json()
    with pytest.raises(KinemimicError, match="surprise"):
        TrainConfig.from_json({**value, "env": {**value["env"], "surprise": 1}})
    del value["env"]["preview"]
    with pytest.raises(KinemimicError, match="preview"):
        TrainConfig.from_json(value)
    with pytest.raises(KinemimicError, match="preview: expected at least one"):
        TrainConfig.from_json({**value, "env": {**value["env"], "preview": []}})
    with pytest.raises(KinemimicError, match="default, robust, paper"):
        preset("none")


@pytest.mark.parametrize(
    ("place", "value"),
    [
        ("action_std", []),
        ("action_std", "x"),
        ("action_std", [[0, None]]),
        ("scales", []),
        ("scales", {"pose": []}),
        ("hidden", [0.5]),
        ("seed", "x"),
        ("kl_penalty", 1),
        ("baseline", "ddpg"),
        ("baseline", {"algorithm": "ddpg", "batch": "x"}),
        ("baseline", {"algorithm": "dddpg"}),
        ("baseline", {"batch": 1}),
        ("env", []),
        ("env.domain_randomization", []),
        ("env.domain_randomization.push", [0.0]),
        ("env.preview", ["a"]),
        ("env.preview", [1e300]),
        ("env.max_drift", "x"),
        ("env.max_drift", 10**400),
        ("env.episode", True),
        ("env.scenario", 5),
        ("env.reward.form", "cubes"),
        ("env.reward.weights", {"poise": 1.0}),
        ("env.reward.scales", {}),
    ],
)
def test_a_value_of_another_type_is_refused(place: str, value: object) -> None:
    """Before it reaches a worker process, whose errors are not one line."""
    config = PRESETS["default"].to_json()
    *way, last = place.split(".")
    at = config
    for name in way:
        at = at[name]
    at[last] = value
    with pytest.raises(KinemimicError, match=rf"^x\.json, key {(*way, last)[0]}.*: expected .*, found "):
        TrainConfig.from_json(config, "x.json")


def test_weights_of_pose_and_reward_sum_to_one() -> None:
    assert sum(POSE_WEIGHTS.values()) == pytest.approx(1.0)
    rewards = {name: dict(config.env.reward.weights) for name, config in PRESETS.items()}
    # The path of `robust` weighs more on top of the rest; a return is told as a share of the largest.
    assert rewards["robust"].pop("path") == pytest.approx(3 * rewards["default"]["path"])
    assert rewards.pop("robust").items() < rewards["default"].items()
    for weights in rewards.values():
        assert sum(weights.values()) == pytest.approx(1.0)


def test_a_schedule_is_linear_between_its_points_and_constant_beyond() -> None:
    schedule = ((100, 8.0), (200, 32.0), (1200, 64.0))
    found = [scheduled_at(schedule, samples) for samples in (0, 100, 150, 200, 700, 1200, 9999)]
    assert found == pytest.approx([8.0, 8.0, 20.0, 32.0, 48.0, 64.0, 64.0])


def test_scheduled_scales_replace_constant_ones() -> None:
    schedules = {"pose": ((100, 8.0), (300, 24.0)), "path": ((0, 1.0), (900, 4.0))}
    config = replace(TrainConfig(), scales=schedules)
    assert config.reward(150).scales == {**config.env.reward.scales, "pose": 12.0, "path": 1.5}
    assert config.final_reward.scales == {**config.env.reward.scales, "pose": 24.0, "path": 4.0}
    assert replace(config, scales={}).final_reward == config.env.reward


@pytest.mark.parametrize("name", PRESETS)
def test_domain_randomization_is_within_the_worlds_limits(name: str) -> None:
    hard = PRESETS[name].env.domain_randomization
    for low, high in (hard.push, hard.rest, hard.friction, hard.mass, hard.delay):
        assert 0.0 <= low <= high
    assert hard.mass[0] >= MIN_MASS
    assert hard.friction[0] <= FRICTION <= hard.friction[1]
