"""Static balance of a live capture: the vertical that puts the centre of mass over the feet.

Offline, `feet/balance.py` turns a whole recording at once. Here the lean is an average of what the person has
shown since they have stood, and comes in and goes out smoothly.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import from_rotvec, rotate
from kinemimic.retarget.feet.balance import (
    EDGE,
    LARGEST_LEAN,
    LOWEST_CENTRE,
    ankle_middle,
    centre_of_mass,
    leaned,
    outside_soles,
)
from kinemimic.retarget.feet.contact import sole_positions
from kinemimic.retarget.feet.scale import body_kinematics

AVERAGE_TIME = 3.0  # s over which the lean is averaged
FADE_TIME = 0.33  # s
STANDS = 0.04  # m by which a foot that carries is above the lower one, at most


class LiveLean:
    """Leans one person, moment by moment. share: 0 to 1, how much of the lean is applied."""

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self.share = 0.0
        self.restart()

    def restart(self) -> None:
        """Forget the lean: another person may be in view."""
        self._lean = np.zeros(2)  # rad, of the head ahead and to the left
        self._seconds = 0.0

    def applied(self, rotations: Array, root: Array, yaw: float, *, on_the_spot: bool) -> tuple[Array, Array]:
        """The pose, rotations (20, 4) and root (3,), turned about the ankles; yaw: its heading, rad."""
        change = 1.0 / (FADE_TIME * self._rate)
        self.share += min(max(float(on_the_spot) - self.share, -change), change)
        if on_the_spot:
            self._average(*self._turned(rotations, root, yaw, 1.0), yaw)
        return self._turned(rotations, root, yaw, self.share) if self.share > 0.0 else (rotations, root)

    def _average(self, rotations: Array, root: Array, yaw: float) -> None:
        """Correct the lean by what is missing in a pose that is turned by it."""
        positions, frames = body_kinematics(rotations[None], root[None])
        heights = sole_positions(positions, frames)[0, ..., 2].min(axis=-1)
        missing = outside_soles(positions, frames, (heights < heights.min() + STANDS)[None], EDGE)[0]
        height = float((centre_of_mass(positions, frames) - ankle_middle(positions))[0, 2])
        self._seconds += 1.0 / self._rate
        span = self._rate * min(self._seconds, AVERAGE_TIME)
        self._lean = self._lean + _turned_by(-yaw, missing) / (max(height, LOWEST_CENTRE) * span)
        size = float(np.linalg.norm(self._lean))
        if size > LARGEST_LEAN:
            self._lean *= LARGEST_LEAN / size

    def _turned(self, rotations: Array, root: Array, yaw: float, share: float) -> tuple[Array, Array]:
        x, y = share * _turned_by(yaw, self._lean)
        below = ankle_middle(body_kinematics(rotations[None], root[None])[0])[0] * [1.0, 1.0, 0.0]
        turned, path = leaned(rotations[None], root[None], from_rotvec(np.array([-y, x, 0.0])), below)
        return turned[0], path[0]


def _turned_by(angle: float, vector: Array) -> Array:
    """A vector (2,) turned about the vertical, rad."""
    upright = from_rotvec(np.array([0.0, 0.0, angle]))
    found: Array = rotate(upright, np.append(vector, 0.0))[:2]
    return found
