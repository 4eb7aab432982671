"""Correct policies on one motion: learn from the errors of their cycles, then one network for all of it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.learning_control import LearningControl
from kinemimic.train.learning_control import distillation, response
from kinemimic.train.learning_control.corrections import steps_of_cycle
from kinemimic.train.learning_control.distillation import distilled
from kinemimic.train.learning_control.learning import LONG, SHARES, learn_corrections
from kinemimic.train.reference.reference import Reference
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.sim.engines import open_world
from kinemimic.train.task.env import ImitationBatch


class Stopped(Exception):  # noqa: N818 (it is no error)
    """The caller does not want a correction to go on."""


def correction_samples(motion: Motion, settings: LearningControl) -> int:
    """Control steps of one correction, at most."""
    measured = settings.iterations + settings.rounds * settings.steps
    cycles = measured * settings.cycles + len(SHARES) * LONG + distillation.CYCLES
    cycles *= settings.environments
    cycles += settings.rounds * response.CYCLES * response.PROBES
    return cycles * steps_of_cycle(motion)


class Correctable(Protocol):
    """An algorithm that trains a policy, and can go on from another one of the same shape."""

    @property
    def config(self) -> TrainConfig: ...

    def policy(self) -> Policy: ...

    def begin_from(self, policy: Policy) -> None: ...


class Corrector:
    """Corrects the policy of an algorithm that imitates a cyclic motion, with threads of the native engine.

    ValueError for a configuration without learning control.
    """

    def __init__(self, algorithm: Correctable, motion: Motion, engine: str, threads: int = 1) -> None:
        config = algorithm.config
        if config.learning_control is None:
            raise ValueError("expected a configuration with learning control")
        self._algorithm, self._settings, self._seed = algorithm, config.learning_control, config.seed
        reference = Reference(motion)
        self._batch, self._probe = (
            ImitationBatch(open_world(count, engine, threads=threads), reference, config.measured_env)
            for count in (config.learning_control.environments, response.PROBES)
        )

    def correct(self, proceed: Callable[[int], bool]) -> Policy | None:
        """The algorithm's policy without its systematic errors at knees and hips.

        proceed: is told samples as they are taken, and says whether to go on. None if it says no, or if
        humanoids always fall.
        """
        policy = self._algorithm.policy()

        def go_on(samples: int) -> None:
            if not proceed(samples):
                raise Stopped

        try:
            corrections = learn_corrections(
                self._batch, self._probe, policy, self._settings, go_on, self._seed
            )
            if corrections is None:
                return None
            go_on(distillation.CYCLES * steps_of_cycle(self._batch.reference) * self._settings.environments)
        except Stopped:
            return None
        return distilled(policy, corrections, self._batch, self._seed)

    def adopt(self, policy: Policy) -> None:
        """Let the algorithm go on from a corrected policy."""
        self._algorithm.begin_from(policy)

    def close(self) -> None:
        """Free the engines."""
        for batch in (self._batch, self._probe):
            batch.world.close()
