"""Settings: stored and restored unchanged, checked, and scheduled correctly."""

from __future__ import annotations

from dataclasses import replace

import pytest

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.train.config.config import TrainConfig, scheduled_at
from kinemimic.train.config.presets import PRESETS, preset


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


@pytest.mark.parametrize(
    ("preset_name", "place", "value"),
    [
        ("default", "num_envs", 0),
        ("default", "horizon", 0),
        ("default", "minibatch", -1),
        ("default", "epochs", 0),
        ("a2c", "baseline.n_steps", 0),
        ("ddpg", "baseline.train_every", 0),
        ("td3", "baseline.policy_delay", 0),
        ("sac", "baseline.batch", 0),
        ("sb3-ppo", "baseline.epochs", 0),
        ("default", "action_std", [[10, 0.1], [0, 0.2]]),
        ("default", "strength", [[0, 0.0], [0, 1.0]]),
        ("default", "scales.pose", [[0, 8.0], [9, 8.0], [5, 8.0]]),
        ("default", "body_error", [[1, 0.5], [0, 0.4]]),
        ("default", "ankle_exploration", 0.0),
        ("default", "ankle_exploration", -1.0),
    ],
)
def test_damaged_numbers_are_refused(preset_name: str, place: str, value: object) -> None:
    config = PRESETS[preset_name].to_json()
    *way, last = place.split(".")
    at = config
    for name in way:
        at = at[name]
    at[last] = value
    with pytest.raises(KinemimicError, match=rf"^x\.json, key {place}: expected .*, found ") as error:
        TrainConfig.from_json(config, "x.json")
    assert "\n" not in str(error.value)


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
