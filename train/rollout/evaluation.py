"""Evaluations during training: episodes of the policy without exploration noise and domain randomization.

Training with domain randomization adds a robustness evaluation (`robustness.py`). The results decide which
policy is kept, so evaluations are due by the number of samples and not by the clock.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from kinemimic.pipeline.gait.curve_metrics import joint_fits
from kinemimic.retarget.humanoid.motion import Motion, joint_angles
from kinemimic.train.config.env_config import EnvConfig, RewardConfig
from kinemimic.train.reference.reference import Reference
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.rollout.rollout import node_rotations, roll_out
from kinemimic.train.scenario.scenario import Scenario
from kinemimic.train.sim.engines import open_world
from kinemimic.train.sim.world import CONTROL_RATE
from kinemimic.train.task.env import ImitationBatch

EVALUATION_INTERVAL = 65_536  # samples
CYCLIC_FRAMES = 600  # 20 s
START_PHASES = 13  # of the reported rollouts of a cycle
SCENARIO_EPISODES = 8
WALKING_R2 = 0.90  # of knee and hip: a humanoid that reaches it without a fall walks


def episode_frames(motion: Motion | Reference) -> int:
    """Control steps of an episode: 20 s of a cycle, a non-cyclic motion once."""
    if motion.cyclic:
        return CYCLIC_FRAMES
    # The last frame counts if its time is a control step up to rounding.
    return max(1, int(motion.duration * CONTROL_RATE + 1e-6))


def reported_phases(motion: Motion) -> tuple[float, ...]:
    """Start phases of the rollouts that are reported, k/13; a non-cyclic motion starts at its beginning."""
    return tuple(k / START_PHASES for k in range(START_PHASES)) if motion.cyclic else (0.0,)


def selection_phases(
    motion: Motion, scenario: Scenario | None = None, episodes: int = 2
) -> tuple[float, ...]:
    """Start phases of the evaluations that choose the policy to keep.

    None is a reported one, so that no score is of a rollout that chose the policy: a cycle has as many as
    `episodes`, midway between reported ones (1/26 and 13/26 if two); a scenario the middles of
    SCENARIO_EPISODES parts of its range, each with its own draw. A non-cyclic motion has only its beginning,
    which is reported too.
    """
    if not motion.cyclic:
        return (0.0,)
    if scenario is None:
        return tuple((k * START_PHASES // episodes + 0.5) / START_PHASES for k in range(episodes))
    low, high = scenario.phase.low[0], scenario.phase.high[0]
    # A single phase is evaluated once: the same phase gives the same draw.
    middles = (low + (high - low) * (k + 0.5) / SCENARIO_EPISODES for k in range(SCENARIO_EPISODES))
    return tuple(dict.fromkeys(middles))


@dataclass(frozen=True)
class Episode:
    """One episode of `of` frames.

    frames: before the fall; reward: mean over all frames, 0 after a fall, as a share of the largest possible;
    knee, hip: R² without credit after a fall, mean of both sides.
    """

    frames: int
    of: int
    reward: float
    knee: float
    hip: float


@dataclass(frozen=True)
class Evaluation:
    """Results after a number of samples and seconds of training.

    strength: 0 to 1, of the domain randomization in training at that time; frames, of: of the episode that
    stayed upright for the smallest share of its length, and that length; knee, hip: minima over all episodes;
    frames_first: of the first episode; reward: mean of the episodes; robust_return: mean reward under domain
    randomization, None where the strength is 0; critic_loss: the critic's mean squared error as a share of
    its targets' variance, mean of the rounds since the last evaluation; completed: number of the `episodes`
    without a fall, None in records of earlier versions; corrected: whether it is of a corrected policy
    (`train/learning_control`).
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
    completed: int | None = None
    episodes: int | None = None
    corrected: bool = False

    @classmethod
    def of_episodes(
        cls,
        episodes: Sequence[Episode],
        robust_returns: Sequence[float] = (),
        *,
        samples: int,
        seconds: float,
        strength: float,
        losses: Sequence[float] = (),
        corrected: bool = False,
    ) -> Evaluation:
        """Summarise episodes, robust returns and the critic's losses."""
        # A tracker's episodes are as long as their motions.
        worst = min(episodes, key=lambda episode: episode.frames / episode.of)
        return cls(
            samples=samples,
            seconds=round(seconds, 1),
            strength=strength,
            frames=worst.frames,
            frames_first=episodes[0].frames,
            of=worst.of,
            reward=sum(episode.reward for episode in episodes) / len(episodes),
            knee=min(episode.knee for episode in episodes),
            hip=min(episode.hip for episode in episodes),
            robust_return=sum(robust_returns) / len(robust_returns) if robust_returns else None,
            critic_loss=round(sum(losses) / len(losses), 6) if losses else None,
            completed=sum(episode.frames == episode.of for episode in episodes),
            episodes=len(episodes),
            corrected=corrected,
        )

    @property
    def falls(self) -> bool:
        """Whether an episode ended in a fall."""
        return self.frames < self.of

    @property
    def walks(self) -> bool:
        """Whether no episode ended in a fall, and knee and hip follow the reference."""
        return not self.falls and min(self.knee, self.hip) >= WALKING_R2

    def to_json(self) -> dict[str, Any]:
        """The constructor's arguments, as JSON."""
        return asdict(self)


def is_due(before: int, after: int, interval: int) -> bool:
    """Whether an evaluation is due between two numbers of samples."""
    return after // interval > before // interval


def best(evaluations: Sequence[Evaluation], *, by_fit: bool = False) -> Evaluation:
    """The evaluation at the greatest strength with the best robust return, or reward; ties: the first.

    by_fit: the one with the best `fit`, for learning control, which gives up some reward for it.
    """
    if by_fit:
        return max(evaluations, key=fit)
    return max(
        evaluations, key=lambda e: (e.strength, e.reward if e.robust_return is None else e.robust_return)
    )


def fit(evaluation: Evaluation) -> tuple[float, float]:
    """What learning control improves: the frames without a fall, then R² of knee and hip."""
    return evaluation.frames / evaluation.of, evaluation.knee + evaluation.hip


def first_walk(evaluations: Sequence[Evaluation]) -> Mapping[str, float] | None:
    """Samples and seconds of the first evaluation that `walks`, None if there is none."""
    for evaluation in evaluations:
        if evaluation.walks:
            return {"samples": evaluation.samples, "seconds": evaluation.seconds}
    return None


class Evaluator:
    """Runs evaluation episodes in its own environment, so that they do not affect the training."""

    def __init__(self, motion: Motion, reference: Reference, config: EnvConfig, engine: str) -> None:
        self._frames = episode_frames(motion)
        if config.scenario is not None and motion.cyclic:
            self._frames = config.scenario.steps
        self._batch = ImitationBatch(open_world(1, engine), reference, config)

    def run_episode(self, policy: Policy, reward: RewardConfig, phase: float) -> Episode:
        """Roll out from a phase up to the end or the fall; nothing counts after a fall."""
        batch, frames = self._batch, self._frames
        batch.reward = reward
        # The seed depends on the phase only: all policies get the same draws of a scenario.
        batch.reset(np.array([0]), np.array([phase]), seeds=np.array([round(1e6 * phase)], dtype=np.uint64))
        rewards, rotations, phases = [], [], np.empty(frames)

        def record(step: int, *_: object) -> None:
            rewards.append(float(batch.terms().sum()))
            rotations.append(node_rotations(batch.bodies)[0])
            phases[step] = batch.phases[0]

        roll_out(batch, policy.act, frames, record)
        upright = len(rewards)
        # After a fall, those of a rollout without it.
        rest = np.arange(1, frames - upright + 1) / (CONTROL_RATE * batch.reference.duration)
        phases[upright:] = (phases[upright - 1] if upright else phase) + rest
        expected = joint_angles(batch.reference.nodes(phases))
        simulated = {name: np.full(frames, curve.mean()) for name, curve in expected.items()}
        if upright:
            for name, curve in joint_angles(np.array(rotations)).items():
                simulated[name][:upright] = curve
        fits = joint_fits(expected, simulated, np.arange(frames) < upright)
        return Episode(
            frames=upright,
            of=frames,
            reward=sum(rewards) / frames / sum(reward.weights.values()),
            knee=fits["knee"].both.r2_upright,
            hip=fits["hip"].both.r2_upright,
        )
