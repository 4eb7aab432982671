"""Pushes of training as hard as the policy can bear, in each direction.

From the front, a humanoid falls at pushes that hardly disturb it from behind, and episodes that end early
teach little. So each environment has a level for each direction, which rises when the policy survives a push
near it and sinks when it falls, like the levels of terrain of N. Rudin et al., "Learning to Walk in Minutes
Using Massively Parallel Deep Reinforcement Learning" (CoRL 2021).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.train.task.domain_randomization import MAX_PUSHES, RandomizationSample

DIRECTIONS = 8
FIRST, LOWEST, HIGHEST = 200.0, 80.0, 900.0  # N
# Factors after a push that was survived, or not: in balance where 53 % are survived.
RISE, FALL = 1.1, 0.9
NEAR = 0.6  # share of the level from which a push counts
PROBATION = 60  # control steps after its begin, or until the next push, in which a fall is a push's
_NAMES = ("levels", "begins", "shares", "directions")
_PREFIX = "push_"


class PushLevels:
    """Levels of E environments, and the pushes of their current episodes.

    levels: (E, DIRECTIONS) N, of the directions 0°, 45° ... counterclockwise from the reference's direction
    of travel; begins: (E, MAX_PUSHES) control steps after the start; shares: (E, MAX_PUSHES) of the level;
    directions: (E, MAX_PUSHES).
    """

    def __init__(self, size: int) -> None:
        self.levels: Array = np.full((size, DIRECTIONS), FIRST)
        self._begins: Array = np.zeros((size, MAX_PUSHES))
        self._shares: Array = np.zeros((size, MAX_PUSHES))
        self._directions: NDArray[np.int64] = np.zeros((size, MAX_PUSHES), dtype=np.int64)

    def applied(
        self, sample: RandomizationSample, indices: NDArray[np.intp], travel: Array, highest: float
    ) -> RandomizationSample:
        """The sample of environments (N,) with its pushes of up to `highest` N as shares of the levels.

        travel: (N, 2) horizontal velocity of the reference at the start.
        """
        x, y = sample.forces[..., 0], sample.forces[..., 1]
        angles = np.arctan2(y, x) - np.arctan2(travel[:, 1], travel[:, 0])[:, None]
        directions = np.mod(np.rint(angles * DIRECTIONS / (2.0 * np.pi)), DIRECTIONS).astype(np.int64)
        self._begins[indices] = sample.begins
        self._shares[indices] = np.hypot(x, y) / highest
        self._directions[indices] = directions
        levels = self.levels[indices[:, None], directions]
        return replace(sample, forces=sample.forces * (levels / highest)[..., None])

    def update(self, ages: NDArray[np.int64], terminated: NDArray[np.bool_]) -> None:
        """After a control step: ages (E,) of the episodes, and whether they ended with a fall (E,)."""
        following = np.concatenate([self._begins[:, 1:], np.full((len(ages), 1), np.inf)], axis=1)
        until = np.minimum(self._begins + PROBATION, following)
        age, fell = ages[:, None], terminated[:, None]
        near = self._shares >= NEAR
        self._multiply(near & ~fell & (age == until), RISE)
        self._multiply(near & fell & (age > self._begins) & (age <= until), FALL)

    def _multiply(self, which: NDArray[np.bool_], factor: float) -> None:
        environments, pushes = np.nonzero(which)  # at most one push of an environment
        at = environments, self._directions[environments, pushes]
        self.levels[at] = np.clip(self.levels[at] * factor, LOWEST, HIGHEST)

    def snapshot(self) -> dict[str, NDArray[Any]]:
        """The complete state for `restore`, arrays (E, ...)."""
        own = (self.levels, self._begins, self._shares, self._directions)
        return {_PREFIX + name: array.copy() for name, array in zip(_NAMES, own, strict=True)}

    def restore(self, snapshot: Mapping[str, NDArray[Any]]) -> None:
        """Set the state to a snapshot, which may hold other arrays too."""
        own = (snapshot[_PREFIX + name].copy() for name in _NAMES)
        self.levels, self._begins, self._shares, self._directions = own
