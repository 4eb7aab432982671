"""What a training needs of whatever learns, so that rounds, trials and checkpoints are the same for all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from torch import Tensor

from kinemimic.train.config.config import RewardConfig, TrainConfig
from kinemimic.train.rollout.evaluation import Episode
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.rollout.sampler import Figures
from kinemimic.train.task.timer import Seconds

# Where a round's time goes; a practice says what became of the rollout's.
ROLLOUT = "rollout"
UPDATE = "update"
OTHER = "other"


@dataclass
class Progress:
    """What changes from round to round beside the networks.

    seconds_by: where the wall time of training went, this call's and those before it (`timer.py`);
    exploded: figures that the engine lost so far; losses: the critic's `normalized_loss` of each round since
    the last trial.
    """

    samples: int = 0
    rounds: int = 0
    seconds_by: dict[str, float] = field(default_factory=dict)
    exploded: int = 0
    losses: list[float] = field(default_factory=list)


class Algorithm(Protocol):
    """What is learnt: networks, optimisers, normaliser, and all else that a checkpoint holds."""

    @property
    def config(self) -> TrainConfig: ...

    @property
    def progress(self) -> Progress: ...

    def policy(self) -> Policy:
        """What it would do now, without exploration."""

    def tensors(self) -> dict[str, Tensor]:
        """Every array of it."""

    def record(self) -> dict[str, Any]:
        """All else of it, as JSON."""

    def restore(self, tensors: dict[str, Tensor], record: dict[str, Any]) -> None:
        """Take up what `tensors` and `record` once gave."""

    def notes(self) -> dict[str, Any]:
        """What the policy's record says of this way of learning alone."""


class Runner(Protocol):
    """What learns, together with the figures that it learns on."""

    @property
    def patience(self) -> float:
        """How many times longer than others it waits between two checkpoints, for theirs are large."""

    def begin(self, figures: Figures | None) -> None:
        """Before the first round of a call: with the figures of a checkpoint, None without one."""

    def round(self) -> dict[str, float]:
        """Sample and learn, ROLLOUT and UPDATE on the timer; returns what is worth logging.

        FloatingPointError if what it learns became infinite or NaN.
        """

    def seconds(self) -> Seconds:
        """What the timer says, with the parts of the rollout in its place."""

    def figures(self) -> Figures:
        """What the next round begins with."""

    def run_episodes(
        self, policy: Policy, reward: RewardConfig, phases: Sequence[float]
    ) -> Sequence[Episode]:
        """Performances from these phases (`trial.py`)."""

    def robust_returns(self, policy: Policy, reward: RewardConfig) -> Sequence[float]:
        """What each of the figures of `ordeal.py` endures."""


def normalized_loss(squared_error: float, variance: float) -> float:
    """A critic's mean squared error as a share of its targets' variance: 1 is a critic that knows but their
    mean, whatever the size of rewards and the way to learn. 0 where the targets do not vary."""
    return squared_error / variance if variance > 0.0 else 0.0
