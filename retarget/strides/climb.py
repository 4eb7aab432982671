"""How far a walk climbs in the capture, which a loop leaves out: it walks on level ground."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.locomotion.bouts import Bout

# Angle from which a walk is said to climb. Optical floors are level to 1 degree, even in strides that speed
# up. A depth sensor's vertical along the view is off by up to 10 degrees where its file has no floor.
MIN_ANGLE = {True: np.radians(2.0), False: np.radians(15.0)}
MIN_CYCLES = 2.0  # strides of a bout that show a depth sensor's climb


@dataclass(frozen=True)
class Climb:
    """stride: metres by which the hips rise in a stride; angle: radians, of the path; total: metres over the
    strides of the bout; precise: whether the recording is accurate to a centimetre."""

    stride: float = 0.0
    angle: float = 0.0
    total: float = 0.0
    precise: bool = True

    @property
    def certain(self) -> bool:
        """Whether it is more than a tilted floor or sensor."""
        return bool(abs(self.angle) > MIN_ANGLE[self.precise])


def climb_of(clip: Clip, bouts: Sequence[Bout]) -> Climb:
    """The climb of the bout, of a clip on the 20 nodes, that climbs or descends farthest."""
    found = [_of_bout(clip.positions[one.frames], one) for one in bouts]
    return max(found, key=lambda one: abs(one.total), default=Climb())


def _of_bout(positions: Array, bout: Bout) -> Climb:
    """Median rise of the hips from each frame to one stride later, in positions (n, 20, 3) as recorded."""
    level = rotate(bout.turn[:, None], positions[:, [N["hip_left"], N["hip_right"]]])
    height = level[..., 2].mean(axis=1)
    used = bout.leg_mask().any(axis=1) & np.isfinite(height)
    if used.sum() < 2 or (not bout.precise and bout.cycles < MIN_CYCLES):
        return Climb(precise=bout.precise)
    first = np.flatnonzero(used & (bout.phase + 1.0 <= bout.phase[-1]))
    later = np.searchsorted(bout.phase, bout.phase[first] + 1.0)
    both = used[later]
    if not both.any():
        return Climb(precise=bout.precise)
    rise = float(np.median(height[later[both]] - height[first[both]]))
    angle = float(np.arctan2(rise, abs(bout.speed) * bout.period))
    return Climb(rise, angle, rise * bout.used_strides, bout.precise)
