"""Whether the person of a live capture goes somewhere, or exercises on the spot."""

from __future__ import annotations

from collections import deque

import numpy as np

from kinemimic.pipeline.arrays import Array

SPAN = 0.6  # s over which the velocity is averaged
# m/s above which a person who strides goes somewhere, and below which they have stopped.
GOES, STAYS = 0.25, 0.10


class OnTheSpot:
    """Follows one person. A squat moves the hips as fast as a slow walk does, but has no strides; a step to
    the side and back has, but leads nowhere."""

    def __init__(self, rate: float) -> None:
        self._velocities: deque[Array] = deque(maxlen=round(SPAN * rate))
        self._found = True

    def update(self, velocity: Array, *, strides: bool) -> bool:
        """At a moment: velocity (2,) of the hips over the ground, m/s; strides: ankles are apart in turns."""
        self._velocities.append(velocity)
        speed = float(np.linalg.norm(np.mean(self._velocities, axis=0)))
        self._found = not strides or speed < (GOES if self._found else STAYS)
        return self._found
