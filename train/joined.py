"""A training that only joins policies (`recovery/joining.py`)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.ppo.ppo import PpoAlgorithm
from kinemimic.train.recovery.joining import join, lesson_samples
from kinemimic.train.recovery.pupils_file import PUPILS
from kinemimic.train.reference.reference import Reference
from kinemimic.train.rollout.evaluation import Evaluation, Evaluator
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.rollout.robustness import ROBUSTNESS_EPISODES, RobustnessEvaluation
from kinemimic.train.runner.checkpoint import TrainingState
from kinemimic.train.runner.policy_file import Imitated, PolicyFile
from kinemimic.train.settings import Settings
from kinemimic.train.task.timer import Timer

JOINING = "joining"  # purpose of the time


def joined(
    run: Path, motion: Motion, settings: Settings, workers: int, engine: str, timer: Timer, *, resume: bool
) -> dict[str, Any]:
    """Join the settings' initial policy with their teachers, and write it; returns its record.

    resume: whether to go on after the rounds that an interrupted call has finished.
    """
    config = settings.config
    if config.joining is None or settings.initial is None or settings.teachers is None:
        raise KinemimicError(
            "joining: expected a training with start and teachers, found a config of your own"
        )
    if not resume:
        (run / PUPILS).unlink(missing_ok=True)
    training = TrainingState(PpoAlgorithm(config))
    imitated = Imitated.of_motion(motion, config)
    file = PolicyFile(run, training, imitated, engine, resumed=False)
    taught = join(motion, settings.initial, settings.teachers, config, run, workers=workers, engine=engine)
    timer.lap(JOINING)
    progress = training.algorithm.progress
    progress.samples, progress.seconds_by = lesson_samples(config.joining), dict(timer.seconds)
    training.best = taught.policy
    training.evaluations.append(_evaluation(motion, taught.policy, training, imitated, engine))
    return file.write(finished=True, taught=taught)


def _evaluation(
    motion: Motion, policy: Policy, training: TrainingState, imitated: Imitated, engine: str
) -> Evaluation:
    """As after a round of PPO; the robust return is among obstacles."""
    config, progress = training.algorithm.config, training.algorithm.progress
    reference, reward = Reference(motion), config.final_reward
    evaluator = Evaluator(motion, reference, config.env, engine)
    robustness = RobustnessEvaluation(reference, config.env, range(ROBUSTNESS_EPISODES), engine)
    return Evaluation.of_episodes(
        [evaluator.run_episode(policy, reward, phase) for phase in imitated.phases],
        robustness.robust_returns(policy, reward),
        samples=progress.samples,
        seconds=sum(progress.seconds_by.values()),
        strength=1.0,
    )
