"""Interfaces between the training loop and the algorithms, ours and the baselines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from torch import Tensor

from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.env_config import RewardConfig
from kinemimic.train.rollout.evaluation import Episode
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.sampling.sampler import EnvStates
from kinemimic.train.task.timer import Seconds

# Purposes of a round's time; a runner subdivides the rollout's.
ROLLOUT = "rollout"
UPDATE = "update"
OTHER = "other"


@dataclass
class TrainingProgress:
    """Counters of a training run.

    seconds_by: wall time by purpose (`timer.py`), of this call and those before it; exploded: humanoids
    whose state the engine lost so far; losses: the critic's `normalized_loss` of each round since the last
    evaluation; corrected_at: samples after the last correction, None before the first.
    """

    samples: int = 0
    rounds: int = 0
    seconds_by: dict[str, float] = field(default_factory=dict)
    exploded: int = 0
    losses: list[float] = field(default_factory=list)
    corrected_at: int | None = None


class Algorithm(Protocol):
    """Networks, optimisers, normaliser, and all other state that a checkpoint holds."""

    @property
    def config(self) -> TrainConfig: ...

    @property
    def progress(self) -> TrainingProgress: ...

    def policy(self) -> Policy:
        """The current policy, without exploration."""

    def tensors(self) -> dict[str, Tensor]:
        """All arrays of the state."""

    def record(self) -> dict[str, Any]:
        """The rest of the state, as JSON."""

    def restore(self, tensors: dict[str, Tensor], record: dict[str, Any]) -> None:
        """Restore the state from `tensors` and `record`."""

    def record_extras(self) -> dict[str, Any]:
        """Entries of the policy's record that only this algorithm has."""


class Runner(Protocol):
    """An algorithm together with its training environments."""

    @property
    def checkpoint_interval_factor(self) -> float:
        """Factor on the time between two checkpoints, above 1 if they are large."""

    def start(self, env_states: EnvStates | None) -> None:
        """Prepare the first round of a call; env_states: of a checkpoint, None without one."""

    def round(self) -> dict[str, float]:
        """Sample and update, with laps ROLLOUT and UPDATE on the timer; returns scalars to log.

        FloatingPointError if a weight or loss became infinite or NaN.
        """

    def seconds(self) -> Seconds:
        """The timer's seconds, with the rollout divided into its parts."""

    def env_states(self) -> EnvStates:
        """The state of the environments from which the next round starts."""

    @property
    def evaluation_interval(self) -> int:
        """Samples between two evaluations."""

    def run_episodes(self, policy: Policy, reward: RewardConfig) -> Sequence[Episode]:
        """Evaluation episodes (`rollout/evaluation.py`)."""

    def robust_returns(self, policy: Policy, reward: RewardConfig) -> Sequence[float]:
        """Robust returns (`rollout/robustness.py`)."""


def normalized_loss(squared_error: float, variance: float) -> float:
    """A critic's mean squared error as a share of its targets' variance, 0 if the targets do not vary.

    A critic that only predicts the mean has 1, regardless of the size of the rewards and the algorithm.
    """
    return squared_error / variance if variance > 0.0 else 0.0
