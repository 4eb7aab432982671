"""Settings of a training run; the presets are in `presets.py`."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np

from kinemimic.pipeline.files.validation.records import RecordError, Steps, convert
from kinemimic.train.config.baseline_config import Activation, Baseline, require_counts
from kinemimic.train.config.env_config import LATER_LIMITS, LATER_RANGES, EnvConfig, RewardConfig
from kinemimic.train.config.joining import Joining
from kinemimic.train.config.learning_control import LearningControl
from kinemimic.train.config.recovery import Recovery

# A value that depends on the samples so far: points (samples, value), linear between them, constant beyond.
Schedule = tuple[tuple[int, float], ...]
PenaltyRule = Literal["running", "initial"]  # see `ppo.adapt_penalty`


def scheduled_at(schedule: Schedule, samples: int) -> float:
    """The value after that many samples."""
    at, values = zip(*schedule, strict=True)
    return float(np.interp(samples, at, values))


@dataclass(frozen=True)
class TrainConfig:
    """Settings of PPO (see `ppo.py`), or of a baseline (see `baseline_config.py`).

    preset: its name in records; env: the task; hidden: units of each hidden layer of actor and critic.
    num_envs: environments; horizon: control steps of each in a round; minibatch: samples per gradient step;
    epochs: passes over a round. clip: half the range of the ratio around 1, None for no clipping. kl_penalty:
    add the penalty of Eq. 6, with its rule (`ppo.adapt_penalty`) and initial coefficient; kl_target: KL
    divergence per round, for the penalty and for adapt_rate. actor_rate, critic_rate: learning rates;
    adapt_rate: adapt the actor's. discount, gae_lambda: of the advantages. action_std: standard deviation of
    the exploration, in units of the action; ankle_exploration: factor on it at the ankles; learn_action_std:
    train it instead. scales: of the terms of the reward; strength: of domain randomization, 0 to 1;
    body_error: metres. entropy: weight of the entropy; entropy_decay: its factor per round. budget: samples
    in total; max_budget: as long as no evaluation walks, training goes on to these, 0 to end at the budget.
    start: SHA-256 of the policy from which training starts, "" for random weights. learning_control: before
    the first round and after the last, None for none. recovery: learned after the last, None for none.
    joining: with teachers, instead of any rounds, None for none.
    Schedules are points (samples, value), linear in between.

    RecordError (a ValueError) for a count below 1, a factor of 0 or less, if `horizon` is not a multiple of
    the baseline's steps, and for a schedule without points or with points out of order.
    """

    preset: str = "default"
    env: EnvConfig = field(default_factory=EnvConfig)
    hidden: tuple[int, ...] = (512, 256)
    num_envs: int = 64
    horizon: int = 64
    minibatch: int = 512
    epochs: int = 8
    clip: float | None = 0.2
    kl_penalty: bool = False
    penalty_rule: PenaltyRule = "running"
    penalty_initial: float = 1.0
    kl_target: float = 0.1
    adapt_rate: bool = True
    actor_rate: float = 3e-4
    critic_rate: float = 1e-3
    discount: float = 0.95
    gae_lambda: float = 0.95
    learn_action_std: bool = False
    action_std: Schedule = ((0, 0.08), (400_000, 0.04), (1_000_000, 0.02))
    ankle_exploration: float = 1.0
    # Scheduled reward scales: a loose pose term learns to walk sooner; a tight one then fits the joints, once
    # the walk is stable.
    scales: dict[str, Schedule] = field(
        default_factory=lambda: {"pose": ((300_000, 8.0), (500_000, 32.0), (1_100_000, 64.0))}
    )
    # Of domain randomization, 0 to 1: a policy that cannot walk yet learns nothing from pushes.
    strength: Schedule = ((0, 0.0),)
    # Replaces a tracker's `max_body_error`, so that it can shrink as the tracker falls less; empty: constant.
    body_error: Schedule = ()
    entropy: float = 0.0
    entropy_decay: float = 1.0
    budget: int = 1_000_000
    max_budget: int = 0
    seed: int = 0
    baseline: Baseline | None = None
    start: str = ""
    learning_control: LearningControl | None = None
    recovery: Recovery | None = None
    joining: Joining | None = None

    def __post_init__(self) -> None:
        require_counts(self, "num_envs", "horizon", "minibatch", "epochs")
        if not self.ankle_exploration > 0.0:
            found = f"{self.ankle_exploration}"
            raise RecordError("ankle_exploration", expected="a factor above 0", found=found)
        schedules = {"action_std": self.action_std, "strength": self.strength}
        schedules |= {f"scales.{name}": schedule for name, schedule in self.scales.items()}
        for name, schedule in schedules.items():
            if not schedule:
                raise RecordError(name, expected="points (samples, value) of a schedule", found="none")
        for name, schedule in {**schedules, "body_error": self.body_error}.items():
            for (before, _), (after, _) in pairwise(schedule):
                if after <= before:
                    expected = "points of a schedule, fewest samples first"
                    raise RecordError(name, expected=expected, found=f"{after} after {before}")
        if self.baseline and self.horizon % self.baseline.steps:
            expected = f"a multiple of the baseline's {self.baseline.steps} steps"
            raise RecordError("horizon", expected=expected, found=f"{self.horizon}")

    @property
    def activation(self) -> Activation:
        """Activation of the policy's hidden units."""
        return self.baseline.activation if self.baseline else "tanh"

    @property
    def bound(self) -> float | None:
        """Largest action of the policy, by a tanh; None if unbounded."""
        return self.baseline.bound if self.baseline else None

    @property
    def batch(self) -> int:
        """Samples of a round."""
        return self.num_envs * self.horizon

    @property
    def largest_budget(self) -> int:
        """Samples after which training ends in any case."""
        return max(self.budget, self.max_budget)

    def reward(self, samples: int) -> RewardConfig:
        """The reward after that many samples."""
        scheduled = {name: scheduled_at(schedule, samples) for name, schedule in self.scales.items()}
        return replace(self.env.reward, scales={**self.env.reward.scales, **scheduled})

    @property
    def final_reward(self) -> RewardConfig:
        """The reward that the schedules end with."""
        return self.reward(max((schedule[-1][0] for schedule in self.scales.values()), default=0))

    @property
    def measured_env(self) -> EnvConfig:
        """The task of a trained policy, with the reward that the schedules end with, as scores state it."""
        return replace(self.env, reward=self.final_reward)

    def to_json(self) -> dict[str, Any]:
        """JSON values that `from_json` reads back."""
        value: dict[str, Any] = msgspec.json.decode(msgspec.json.encode(self))
        # The JSON stays as before these were introduced where it does without them.
        for key in ("baseline", "learning_control", "recovery", "joining"):
            if getattr(self, key) is None:
                del value[key]
        if not self.start:
            del value["start"]
        if not self.body_error:
            del value["body_error"]
        if not self.max_budget:
            del value["max_budget"]
        if self.ankle_exploration == 1.0:
            del value["ankle_exploration"]
        for name in ("scenario", "tracking", "balance", "hurry", "observed_obstacles"):
            if not getattr(self.env, name):
                del value["env"][name]
        for key, later in (("domain_randomization", LATER_RANGES), ("tracking", LATER_LIMITS)):
            stated = value["env"].get(key, {})
            for name, unused in later.items():
                if name in stated and stated[name] == unused:
                    del stated[name]
        return value

    @classmethod
    def from_json(
        cls, value: Any, path: Path | str = "a training configuration", within: Steps = ()
    ) -> TrainConfig:
        """The configuration of a stored policy; a KinemimicError names the first key that does not fit.

        path, within: the file and the configuration's key in it, for messages.
        """
        if isinstance(value, dict):
            env = value.get("env")
            later = {"start": "", "body_error": [], "max_budget": 0, "ankle_exploration": 1.0}
            stages = dict.fromkeys(("baseline", "learning_control", "recovery", "joining"))
            value = {**stages, **later, **value}
            if isinstance(env, dict):
                value["env"] = env = {
                    "scenario": None,
                    "tracking": None,
                    "balance": False,
                    "hurry": False,
                    "observed_obstacles": 0,
                    **env,
                }
                if isinstance(env["tracking"], dict):
                    env["tracking"] = {**LATER_LIMITS, **env["tracking"]}
                drawn = env.get("domain_randomization")
                if isinstance(drawn, dict):
                    env["domain_randomization"] = {**LATER_RANGES, **drawn}
        return convert(value, cls, path, complete=True, within=within)
