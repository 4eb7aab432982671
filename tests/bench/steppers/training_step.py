"""What a control step of training costs beside the learner: our engine, then observation and reward."""

from __future__ import annotations

import figure
import numpy as np
from measuring import print_alone

from kinemimic.train.config.env_config import EnvConfig
from kinemimic.train.reference.reference import Reference
from kinemimic.train.sim.engines import open_world
from kinemimic.train.sim.world import CONTROL_RATE
from kinemimic.train.task.env import ACTIONS, ImitationBatch

FIGURES = 16  # as our engine alone; a process of a training on two cores has twice as many


class TrainingStep:
    figures = FIGURES
    seconds = 1.0 / CONTROL_RATE

    def __init__(self, engine: str) -> None:
        self._reference = Reference(figure.march())
        self._batch = ImitationBatch(open_world(FIGURES, engine=engine), self._reference, EnvConfig())
        self._actions = np.zeros((FIGURES, ACTIONS))

    def stand(self) -> None:
        self._batch.reset(np.arange(FIGURES), np.zeros(FIGURES))

    def fall(self) -> None:
        self._batch.world.reset(np.arange(FIGURES), figure.falling(self._reference, FIGURES))

    def step(self) -> None:
        self._batch.step(self._actions)

    def height(self) -> float:
        return float(self._batch.bodies.positions[:, 0, 2].mean())


def open_stepper(engine: str = "native") -> TrainingStep:
    return TrainingStep(engine)


if __name__ == "__main__":
    print_alone(__file__)
