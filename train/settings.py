"""The settings of one training: from a preset or a tracker, for a motion, with what the user changes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import file_hash
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.from_tracker import OBSTACLES, from_tracker
from kinemimic.train.config.presets import preset
from kinemimic.train.config.tracker import TRACKER
from kinemimic.train.learning_control.corrector import correction_samples
from kinemimic.train.recovery.teachers import Teachers, load_teachers
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.rollout.tracker_file import load_tracker, tracker_path
from kinemimic.train.scenario.event_schedule import check
from kinemimic.train.scenario.route import reference_for
from kinemimic.train.scenario.scenario import Scenario
from kinemimic.train.tracker.suitability import without_strides

LEAST = 1_000_000  # samples: searches take longer than that, and would be for a policy that still changes


@dataclass(frozen=True)
class Settings:
    """initial: the policy to start from, None for random weights; reserved: samples of a correction;
    teachers: to join it with."""

    config: TrainConfig
    initial: Policy | None
    reserved: int
    teachers: Teachers | None = None


def settings_for(
    motion: Motion,
    *,
    preset_name: str = "default",
    seed: int = 0,
    start: str | None = None,
    config: TrainConfig | None = None,
    budget: int | None = None,
    scenario: Scenario | None = None,
    report: Mapping[str, Any] | None = None,
    teachers: Path | None = None,
) -> Settings:
    """Settings for a motion; arguments as in `command.train`. report: the motion's gait.json, if any.

    teachers: folder of the policies to join it with.

    KinemimicError for a tracker that cannot be read or has learned no such motion, a budget below one sample,
    a scenario that does not suit the motion, and teachers that are missing or do not fit.
    """
    initial: Policy | None = None
    if start is not None:
        initial, config = from_start(start, preset_name, seed)
        if config.env.balance and not without_strides(motion, report):
            raise KinemimicError(
                f"--from {start}: expected a motion without strides, all that this tracker has learned, "
                f"found a gait; use --from {TRACKER}"
            )
    if config is None:
        config = from_random_weights(preset_name, seed)
    given = {"budget": budget, "scenario": scenario}
    require_teachers(preset_name, teachers, [name for name, value in given.items() if value is not None])
    if config.joining is not None and teachers is not None:
        if not motion.cyclic:
            raise KinemimicError(
                f"--preset {OBSTACLES}: expected a walk or run that repeats itself, found a motion that does "
                "not; retarget without --as-recorded"
            )
        return Settings(config, initial, 0, load_teachers(Path(teachers), config.env))
    if scenario is not None:
        config = replace(config, env=replace(config.env, scenario=scenario))
    if config.env.scenario is not None:
        check(config.env.scenario, reference_for(motion, config.env.scenario))
    if budget is not None:
        config = replace(config, budget=budget, max_budget=0)
    if config.budget < 1:
        raise KinemimicError(f"expected a budget of at least one sample, found {config.budget}")
    config, reserved = _with_learning_control(_with_recovery(config, motion), motion)
    return Settings(config, initial, reserved)


def require_teachers(preset_name: str, teachers: Path | str | None, limits: Iterable[str] = ()) -> None:
    """KinemimicError unless there are teachers for the preset `obstacles`, and for no other.

    limits: options that were given for the length or the task of the training, which its lessons cannot have.
    """
    if preset_name != OBSTACLES and teachers is not None:
        raise KinemimicError(f"--teachers: expected --preset {OBSTACLES}, found {preset_name}")
    if preset_name == OBSTACLES and teachers is None:
        raise KinemimicError(
            f"--preset {OBSTACLES}: expected --teachers, a folder of policies trained among obstacles, found "
            "none; `kinemimic compare RUN@several-obstacles --preset td3 --seeds 3 --budgets 1e6` trains some"
        )
    for limit in limits if preset_name == OBSTACLES else ():
        raise KinemimicError(
            f"--preset {OBSTACLES}: expected lessons of a fixed length and task, found --{limit}"
        )


def from_start(name: str, preset_name: str, seed: int = 0) -> tuple[Policy, TrainConfig]:
    """The tracker of this name or folder, and the settings of a training that starts from it.

    KinemimicError unless there is such a tracker, and the preset has settings for it.
    """
    path = tracker_path(name)
    policy, record = load_tracker(path)
    settings = TrainConfig.from_json(record["config"], path.with_suffix(".json"), ("config",))
    config = from_tracker(preset_name, settings, file_hash(path), seed)
    return policy.widened(config), config


def from_random_weights(preset_name: str, seed: int = 0) -> TrainConfig:
    """The settings of a preset; KinemimicError for one that only continues a policy."""
    if preset_name == OBSTACLES:
        raise KinemimicError(f"--preset {OBSTACLES}: expected --from robust_walk, or a tracker, found none")
    return preset(preset_name, seed=seed)


def _with_learning_control(config: TrainConfig, motion: Motion) -> tuple[TrainConfig, int]:
    """The configuration and the samples of a correction; without learning control where it does not apply.

    It does not on a motion that does not repeat itself, in a scenario, and if two corrections and a round
    exceed the budget.
    """
    if config.learning_control is None:
        return config, 0
    samples = correction_samples(motion, config.learning_control)
    if not motion.cyclic or config.env.scenario or config.budget < 2 * samples + config.batch:
        return replace(config, learning_control=None), 0
    return config, samples


def _with_recovery(config: TrainConfig, motion: Motion) -> TrainConfig:
    """The configuration, without recoveries on a motion that does not repeat itself, in a scenario, and after
    a training of fewer than LEAST samples."""
    if motion.cyclic and config.env.scenario is None and config.budget >= LEAST:
        return config
    return replace(config, recovery=None)
