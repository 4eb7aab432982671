"""Settings of trainings that start from a tracker: the network's inputs stay those that it has learned."""

from __future__ import annotations

from dataclasses import replace

import pytest

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.env_config import DomainRandomization
from kinemimic.train.config.from_tracker import BUDGETS, NAMES, OBSTACLES, TRAIN_OPTIONS, from_tracker
from kinemimic.train.config.joining import Joining
from kinemimic.train.config.presets import PRESETS
from kinemimic.train.config.recovery import Recovery
from kinemimic.train.config.tracker import standing_config, tracker_config

TRACKER = tracker_config()


def unusual_tracker() -> TrainConfig:
    """A tracker whose inputs are those of no preset."""
    tracking = replace(TRACKER.env.tracking, leash=0.7) if TRACKER.env.tracking else None
    env = replace(TRACKER.env, preview=(2, 3), mirror=False, tracking=tracking)
    return replace(TRACKER, env=env, hidden=(24, 12))


@pytest.mark.parametrize("preset", NAMES)
def test_the_task_stays_the_trackers(preset: str) -> None:
    tracker = unusual_tracker()
    found = from_tracker(preset, tracker, "f00d", 3)
    assert (found.preset, found.start, found.seed, found.hidden) == (NAMES[preset], "f00d", 3, (24, 12))
    assert found.env.preview == (2, 3)
    assert not found.env.mirror
    assert found.env.tracking is not None
    assert found.env.tracking.leash == 0.7
    for what in ("residual", "velocity_feedforward", "torque_feedforward"):
        assert getattr(found.env, what) == getattr(tracker.env, what)
    # What `train` is told to repeat it.
    assert found.budget == BUDGETS[found.preset]
    start = "robust_walk" if preset == OBSTACLES else "tracker"
    assert TRAIN_OPTIONS[found.preset].startswith(f"--from {start}")


def test_only_the_robust_one_is_pushed_and_outlasts_a_recovery() -> None:
    polish, robust = (from_tracker(preset, TRACKER, "f00d") for preset in ("default", "robust"))
    assert polish.env.domain_randomization == DomainRandomization()
    assert robust.env.domain_randomization.push[1] >= PRESETS["robust"].env.domain_randomization.push[1]
    assert robust.env.tracking is not None
    assert polish.env.tracking is not None
    assert robust.env.tracking.max_body_error > polish.env.tracking.max_body_error
    assert (polish.budget, polish.max_budget) == (280_000, 1_000_000)
    assert robust.max_budget == 0
    assert polish.learning_control is not None
    assert robust.learning_control is None
    assert polish.recovery is None
    assert robust.recovery == Recovery()
    assert (polish.env.tracking.limit, polish.env.tracking.arm_limit) == (3.0, 1.0)
    assert (robust.env.tracking.limit, robust.env.tracking.arm_limit) == (8.0, 1.0)
    assert robust.env.max_height_error > polish.env.max_height_error
    # It comes back to the reference in the end.
    assert robust.measured_env.reward.weights["path"] > polish.measured_env.reward.weights["path"]


def test_only_the_one_for_obstacles_observes_them() -> None:
    robust, obstacles = (from_tracker(preset, TRACKER, "f00d") for preset in ("robust", "obstacles"))
    assert robust.env.observed_obstacles == 0 < obstacles.env.observed_obstacles
    assert robust.env.domain_randomization.obstacles == 0.0
    # Pushes are what it started from can do; it is joined with that.
    assert obstacles.env.domain_randomization.obstacles == 1.0
    assert obstacles.env.domain_randomization.push == (0.0, 0.0)
    assert obstacles.joining == Joining()
    assert robust.joining is None
    assert TrainConfig.from_json(obstacles.to_json()) == obstacles
    assert "observed_obstacles" not in robust.to_json()["env"]
    assert "obstacles" not in robust.to_json()["env"]["domain_randomization"]
    assert TrainConfig.from_json(robust.to_json()) == robust


def test_a_tracker_of_motions_on_the_spot_is_polished_without_learning_control() -> None:
    found = from_tracker("default", standing_config(), "f00d", 3)
    assert found.preset == "standing-polish"
    assert found.env.balance
    assert found.learning_control is None
    assert (found.budget, found.max_budget) == (BUDGETS[found.preset], 0)
    assert TRAIN_OPTIONS[found.preset] == "--from standing"
    with pytest.raises(KinemimicError, match="--preset robust: expected a policy for walks and runs"):
        from_tracker("robust", standing_config(), "f00d")


def test_other_presets_have_no_settings_for_a_tracker() -> None:
    with pytest.raises(
        KinemimicError, match="--from: expected --preset robust or obstacles, or none, found paper"
    ):
        from_tracker("paper", TRACKER, "f00d")
