"""Adaptive sampling: motions that a tracker fails at get more of its samples."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array

RATE = 0.2  # of the moving means, per episode
# Share of uniform draws. Without it, sampling would collapse onto motions that nobody can perform.
FLOOR = 0.3


class Outcome(NamedTuple):
    """An episode that ended: of which motion, whether it failed, after how many steps."""

    motion: int
    failed: bool
    steps: int


class MotionStatistics:
    """Moving means of M motions.

    failures: (M,) share of failed episodes, 1 before the first one; lengths: (M,) steps of an episode.
    """

    def __init__(self, motions: int, length: float) -> None:
        self.failures: Array = np.ones(motions)
        self.lengths: Array = np.full(motions, length)

    def update(self, outcomes: Iterable[Outcome]) -> None:
        """Update the means with ended episodes."""
        for motion, failed, steps in outcomes:
            self.failures[motion] += RATE * (float(failed) - self.failures[motion])
            self.lengths[motion] += RATE * (steps - self.lengths[motion])

    def weights(self) -> NDArray[np.float64]:
        """Probabilities (M,) with which episodes draw the motions.

        The samples of a motion, not its episodes, are in proportion to its failures: an episode that fails at
        once gives few samples, and those motions would hardly ever be practised.
        """
        wanted = self.failures / self.lengths
        uniform = np.full(len(wanted), 1.0 / len(wanted))
        total = wanted.sum()
        return uniform if total <= 0.0 else (1.0 - FLOOR) * wanted / total + FLOOR * uniform
