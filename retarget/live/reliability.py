"""Which parts of a live capture are reliable, by what it has shown in the last seconds.

Offline, `strides/sensor_reliability.py` decides from whole strides. Here the same limits hold for bone
lengths and widths of the last SECONDS, and a part fades from measured to neutral and back.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.locomotion.leg_pose import leg_bones
from kinemimic.retarget.strides.sensor_reliability import MAX_BONE_SPREAD, MAX_WIDTH_SPREAD

SECONDS = 8.0
FADE = 0.1  # of the weight per moment
_HYSTERESIS = 1.3


class LiveReliability:
    """precise: the legs are accurate to a centimetre; pelvis, torso: weights 0 (neutral) to 1 (measured).

    bones: (4,) m, median lengths of thighs and shanks.
    """

    def __init__(self, rate: float) -> None:
        self.precise = False
        self.pelvis = self.torso = 1.0
        self.bones: Array = np.full(4, np.nan)
        self._rows: deque[Array] = deque(maxlen=round(SECONDS * rate))
        self._steady = {"hip": False, "shoulder": False}
        self._begun = False

    def update(self, positions: Array, now: int, *, walking: bool) -> None:
        """Look at the moment in row `now` of positions (M, 20, 3). In walking, the trunk of a sensor that is
        not precise is neutral."""
        rows = np.column_stack([leg_bones(positions), *(_width(positions, line) for line in self._steady)])
        if not self._rows:
            self._rows.extend(rows[:now])
        self._rows.append(rows[now])
        known = np.array(self._rows)
        with np.errstate(invalid="ignore"):
            spread = _spread(known)
        self.bones = _medians(known[:, :4])
        for k, line in enumerate(self._steady):
            limit = MAX_WIDTH_SPREAD * (_HYSTERESIS if self._steady[line] else 1.0)
            self._steady[line] = bool(spread[4 + k] < limit)
        limit = MAX_BONE_SPREAD * (_HYSTERESIS if self.precise else 1.0)
        self.precise = bool(spread[:4].max() < limit) and self._steady["hip"]
        pelvis = float(self.precise or not walking)
        torso = float((self.precise and self._steady["shoulder"]) or not walking)
        if not self._begun:
            self.pelvis, self.torso, self._begun = pelvis, torso, True
        self.pelvis += min(max(pelvis - self.pelvis, -FADE), FADE)
        self.torso += min(max(torso - self.torso, -FADE), FADE)


def _width(positions: Array, line: str) -> Array:
    return np.asarray(
        np.linalg.norm(positions[:, N[f"{line}_left"]] - positions[:, N[f"{line}_right"]], axis=-1)
    )


def _spread(rows: Array) -> Array:
    """Standard deviation over mean of columns (M, K), NaN left out; infinite where nothing was seen."""
    out = np.full(rows.shape[1], np.inf)
    for k, column in enumerate(rows.T):
        seen = column[np.isfinite(column)]
        if len(seen):
            out[k] = float(np.std(seen) / max(float(np.mean(seen)), 1e-6))
    return out


def _medians(rows: Array) -> Array:
    return np.array([np.median(c[np.isfinite(c)]) if np.isfinite(c).any() else np.nan for c in rows.T])
