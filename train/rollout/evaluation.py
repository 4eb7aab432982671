"""Trials: now and then in a training the policy performs its reference, without noise and without hardships;
and, if it trains under hardships, under those too (`ordeal.py`).

What it does decides which policy is kept, so it depends on the number of samples and not on the clock.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from kinemimic.pipeline.gait.curve_metrics import joint_fits
from kinemimic.retarget.humanoid.motion import Motion, joint_angles
from kinemimic.train.config.config import EnvConfig, RewardConfig
from kinemimic.train.reference.reference import Reference
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.rollout.rollout import node_rotations, roll_out
from kinemimic.train.scenario.scenario import Scenario
from kinemimic.train.sim.engines import open_world
from kinemimic.train.sim.world import CONTROL_RATE
from kinemimic.train.task.env import ImitationBatch

EVERY = 65_536  # samples between two trials
FRAMES = 600  # 20 s of what goes on for ever
SCENES = 8  # draws of a scenario
WALKS = 0.90  # R² of knee and hip from which a figure that does not fall counts as doing its motion


def frames_of(motion: Motion) -> int:
    """Control steps of a performance: 20 s of a cycle, anything else once."""
    if motion.cyclic:
        return FRAMES
    # The motion's last frame still counts when its time falls on a control step but for rounding.
    return max(1, int(motion.duration * CONTROL_RATE + 1e-6))


def start_phases(motion: Motion, scenario: Scenario | None = None) -> tuple[float, ...]:
    """Where in the reference the attempts of a trial begin: a walk also with the other foot, and SCENES times
    in a scenario, which each draws for itself."""
    if scenario is not None:
        low, high = scenario.phase.low[0], scenario.phase.high[0]
        # A single phase is tried once: from the same phase the draw is the same.
        phases = dict.fromkeys(low + (high - low) * k / SCENES for k in range(SCENES))
        return tuple(phases) if motion.cyclic else (0.0,)
    return (0.0, 0.5) if motion.cyclic else (0.0,)


@dataclass(frozen=True)
class Episode:
    """One performance of `of` frames.

    frames: before the fall; reward: its mean over all frames, 0 for those after a fall, as a share of the
    largest possible; knee, hip: R² that credits nothing after a fall, mean of both sides.
    """

    frames: int
    of: int
    reward: float
    knee: float
    hip: float


@dataclass(frozen=True)
class Evaluation:
    """The attempts after so many samples and seconds of training.

    strength: 0 to 1, of the hardships that the policy trained under by then; frames, knee, hip: the least of
    all attempts; frames_first: of the one from phase 0; reward: their mean; endured: the mean reward under
    hardships, None where the strength is 0; critic_loss: its mean squared error as a share of its targets'
    variance, mean of the rounds since the trial before.
    """

    samples: int
    seconds: float
    strength: float
    frames: int
    frames_first: int
    of: int
    reward: float
    knee: float
    hip: float
    robust_return: float | None = None
    critic_loss: float | None = None

    @classmethod
    def of_episodes(
        cls,
        run_episodes: Sequence[Episode],
        robust_return: Sequence[float] = (),
        *,
        samples: int,
        seconds: float,
        strength: float,
        losses: Sequence[float] = (),
    ) -> Evaluation:
        """What the attempts, the one from phase 0 first, the rewards under hardships and the critic's losses
        come to."""
        return cls(
            samples=samples,
            seconds=round(seconds, 1),
            strength=strength,
            frames=min(run_episode.frames for run_episode in run_episodes),
            frames_first=run_episodes[0].frames,
            of=run_episodes[0].of,
            reward=sum(run_episode.reward for run_episode in run_episodes) / len(run_episodes),
            knee=min(run_episode.knee for run_episode in run_episodes),
            hip=min(run_episode.hip for run_episode in run_episodes),
            robust_return=sum(robust_return) / len(robust_return) if robust_return else None,
            critic_loss=round(sum(losses) / len(losses), 6) if losses else None,
        )

    @property
    def walks(self) -> bool:
        """Whether no attempt fell and knee and hip follow the reference."""
        return self.frames == self.of and min(self.knee, self.hip) >= WALKS

    def to_json(self) -> dict[str, Any]:
        """JSON values: the arguments of the constructor."""
        return asdict(self)


def is_due(before: int, after: int) -> bool:
    """Whether a trial falls between two numbers of samples."""
    return after // EVERY > before // EVERY


def best(trials: Sequence[Evaluation]) -> Evaluation:
    """Among those of the greatest strength the one of the highest reward, under hardships if there are any;
    the earliest of equals."""
    return max(trials, key=lambda t: (t.strength, t.reward if t.robust_return is None else t.robust_return))


def first_walk(trials: Sequence[Evaluation]) -> Mapping[str, float] | None:
    """Samples and seconds at the first trial that `walks`, None if there is none."""
    for trial in trials:
        if trial.walks:
            return {"samples": trial.samples, "seconds": trial.seconds}
    return None


class Evaluator:
    """A figure of its own for the attempts, so that those that train know nothing of them."""

    def __init__(self, motion: Motion, reference: Reference, config: EnvConfig, engine: str) -> None:
        self._frames = frames_of(motion)
        if config.scenario is not None and motion.cyclic:
            self._frames = config.scenario.steps
        self._batch = ImitationBatch(open_world(1, engine), reference, config)

    def run_episode(self, policy: Policy, reward: RewardConfig, phase: float) -> Episode:
        """Perform from a phase, up to the end or the fall: what would come after it counts for nothing."""
        batch, frames = self._batch, self._frames
        batch.reward = reward
        # Of a scenario from each phase always the same draw, so that two policies compare.
        batch.reset(np.array([0]), np.array([phase]), seeds=np.array([round(1e6 * phase)], dtype=np.uint64))
        rewards, rotations = [], []

        def record(*_: object) -> None:
            rewards.append(float(batch.terms().sum()))
            rotations.append(node_rotations(batch.bodies)[0])

        roll_out(batch, policy.act, frames, record)
        stood = len(rewards)
        # The phases that a figure which does not fall goes through.
        phases = phase + np.arange(1, frames + 1) / (CONTROL_RATE * batch.reference.duration)
        wanted = joint_angles(batch.reference.nodes(phases))
        done = {name: np.full(frames, curve.mean()) for name, curve in wanted.items()}
        if stood:
            for name, curve in joint_angles(np.array(rotations)).items():
                done[name][:stood] = curve
        fits = joint_fits(wanted, done, np.arange(frames) < stood)
        return Episode(
            frames=stood,
            of=frames,
            reward=sum(rewards) / frames / sum(reward.weights.values()),
            knee=fits["knee"].both.r2_upright,
            hip=fits["hip"].both.r2_upright,
        )
