"""Limits that only push one way, such as the ground's, in least squares solved by steps."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array


class OneSided:
    """What remembers where a limit was broken.

    A step that puts something back within its limit mostly overshoots by a little. Let go at once, it would
    break the limit as before with the next step, and the steps would never settle: so whatever once was
    beyond still counts a little while it is within by less than `held`.
    """

    def __init__(self, shape: tuple[int, ...], held: float) -> None:
        self._broken = np.zeros(shape, dtype=np.bool_)
        self._held = held

    def weight(self, inside: Array, window: slice) -> Array:
        """0 to 1, how far the limit counts in the frames of a window; inside: how far each value is within
        it, negative beyond.
        """
        broken = self._broken[window]
        broken |= inside < 0.0
        return np.where(inside < 0.0, 1.0, broken * np.clip(1.0 - inside / self._held, 0.0, 1.0) ** 2)
