"""Adaptive sampling: motions that a tracker fails at are drawn more often."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array

RATE = 0.05  # of the moving mean of failures, per episode
# Share of uniform draws. Without it, sampling would collapse onto motions that nobody can perform.
FLOOR = 0.3


def update_failures(failures: Array, outcomes: Iterable[tuple[int, bool]]) -> None:
    """Update the moving means (M,) of failures, in place, with (motion, failed) of ended episodes."""
    for motion, failed in outcomes:
        failures[motion] += RATE * (float(failed) - failures[motion])


def draw_weights(failures: Array) -> NDArray[np.float64]:
    """Probabilities (M,) of the motions, given the moving means of their failures."""
    total = failures.sum()
    uniform = np.full(len(failures), 1.0 / len(failures))
    return uniform if total <= 0.0 else (1.0 - FLOOR) * failures / total + FLOOR * uniform
