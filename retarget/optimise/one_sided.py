"""One-sided constraints, such as the ground's, in iterative least squares."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array


class OneSided:
    """The active set of one-sided constraints, with gradual release.

    A step that restores a constraint usually overshoots slightly. Released at once, the value would violate
    the constraint again with the next step, and the iteration would not converge. A constraint that was
    violated once therefore keeps a decreasing weight until the value is inside by `release`.
    """

    def __init__(self, shape: tuple[int, ...], release: float) -> None:
        self._violated = np.zeros(shape, dtype=np.bool_)
        self._release = release

    def weight(self, inside: Array, window: slice) -> Array:
        """Weights, 0 to 1, in the frames of a window; inside: distance within the limit, negative beyond."""
        violated = self._violated[window]
        violated |= inside < 0.0
        return np.where(inside < 0.0, 1.0, violated * np.clip(1.0 - inside / self._release, 0.0, 1.0) ** 2)
