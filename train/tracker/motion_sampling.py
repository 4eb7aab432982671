"""Adaptive sampling: motions that a tracker performs in some episodes and not in others get more samples."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array

RATE = 0.2  # of the moving means, per episode
# Share of uniform draws. Without it, a motion whose episodes all fail, or none, would never be drawn again.
FLOOR = 0.3


class Outcome(NamedTuple):
    """An episode that ended: of which motion, whether it failed, after how many steps."""

    motion: int
    failed: bool
    steps: int


class MotionStatistics:
    """Moving means of M motions.

    failures: (M,) share of failed episodes, ½ before the first one, so that a motion that nobody has tried is
    drawn as often as any; lengths: (M,) steps of an episode.
    """

    def __init__(self, motions: int, length: float) -> None:
        self.failures: Array = np.full(motions, 0.5)
        self.lengths: Array = np.full(motions, length)

    def update(self, outcomes: Iterable[Outcome]) -> None:
        """Update the means with ended episodes."""
        for motion, failed, steps in outcomes:
            self.failures[motion] += RATE * (float(failed) - self.failures[motion])
            self.lengths[motion] += RATE * (steps - self.lengths[motion])

    def weights(self) -> NDArray[np.float64]:
        """Probabilities (M,) with which episodes draw the motions.

        The samples of a motion are in proportion to p (1 - p), p its share of failed episodes (Rutherford et
        al. 2024, "No regrets: investigating and improving regret approximations for curriculum discovery"):
        a tracker learns nothing where it always succeeds, and little where it always fails. The samples, not
        the episodes: an episode that fails at once gives few, and those motions would hardly be practised.
        """
        wanted = self.failures * (1.0 - self.failures) / self.lengths
        uniform = np.full(len(wanted), 1.0 / len(wanted))
        total = wanted.sum()
        return uniform if total <= 0.0 else (1.0 - FLOOR) * wanted / total + FLOOR * uniform
