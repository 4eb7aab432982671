"""Our own engine: physics and stable PD of a batch, no observation and no reward."""

from __future__ import annotations

import figure
import numpy as np
from measuring import print_alone

from kinemimic.train.reference.reference import Reference
from kinemimic.train.sim.engines import open_world
from kinemimic.train.sim.world import CONTROL_RATE

FIGURES = 16


class Native:
    figures = FIGURES
    seconds = 1.0 / CONTROL_RATE

    def __init__(self, engine: str, threads: int) -> None:
        self._world = open_world(FIGURES, engine=engine, threads=threads)
        self._reference = Reference(figure.march())
        self._targets = figure.targets(self._reference, FIGURES)
        self._count = 0

    def stand(self) -> None:
        self._count = 0
        self._world.reset(np.arange(FIGURES), figure.standing(self._reference, FIGURES))

    def fall(self) -> None:
        self._world.reset(np.arange(FIGURES), figure.falling(self._reference, FIGURES))

    def step(self) -> None:
        self._world.step(*self._targets[self._count % figure.PERIOD])
        self._count += 1

    def height(self) -> float:
        return float(self._world.states().positions[:, 0, 2].mean())


def open_stepper(engine: str = "native", threads: int = 1) -> Native:
    return Native(engine, threads)


if __name__ == "__main__":
    print_alone(__file__)
