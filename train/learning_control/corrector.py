"""Correct policies on one motion: learn from the errors of their cycles, then one network for all of it."""

from __future__ import annotations

from collections.abc import Callable

from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.learning_control import LearningControl
from kinemimic.train.learning_control.corrections import learn_corrections, steps_of_cycle
from kinemimic.train.learning_control.distillation import CYCLES, distilled
from kinemimic.train.reference.reference import Reference
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.sim.engines import open_world
from kinemimic.train.task.env import ImitationBatch


def correction_samples(motion: Motion, settings: LearningControl) -> int:
    """Control steps of one correction."""
    cycles = (settings.iterations + 1) * settings.cycles + CYCLES
    return cycles * steps_of_cycle(motion) * settings.environments


class Corrector:
    """Corrects policies that imitate a cyclic motion, with threads of the native engine. samples: control
    steps of a correction.

    ValueError for a configuration without learning control.
    """

    def __init__(self, motion: Motion, config: TrainConfig, engine: str, threads: int = 1) -> None:
        if config.learning_control is None:
            raise ValueError("expected a configuration with learning control")
        self._settings, self._seed = config.learning_control, config.seed
        reference = Reference(motion)
        self.samples = correction_samples(motion, config.learning_control)
        world = open_world(config.learning_control.environments, engine, threads=threads)
        self._batch = ImitationBatch(world, reference, config.measured_env)

    def correct(self, policy: Policy, proceed: Callable[[int], bool]) -> Policy | None:
        """The policy without its systematic errors at knees and hips.

        proceed: is told samples as they are taken, and says whether to go on. None if it says no, or if
        humanoids always fall.
        """
        corrections = learn_corrections(self._batch, policy, self._settings, proceed)
        if corrections is None or not proceed(self.samples - corrections.samples):
            return None
        return distilled(policy, corrections, self._batch, self._seed)

    def close(self) -> None:
        """Free the engine."""
        self._batch.world.close()
