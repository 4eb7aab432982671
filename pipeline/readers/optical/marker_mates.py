"""Where a marker belongs, by its distances to others.

Most distances between the markers of a segment, and of its neighbours, hardly change: these neighbours are a
marker's mates. A position that is off the usual distances to them is not that marker's, or the body is in a
pose that the recording rarely has.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.vectors import distances

# Metres, standard deviation by the deviation that a tenth of the frames exceeds: the median one would be that
# of standing, in a recording of a few steps. The distances within a rigid segment vary by 0.002 to 0.01, and
# those across one joint by 0.01 to 0.03.
_MAX_SPREAD, _QUANTILE, _SD_OVER_QUANTILE = 0.03, 0.9, 1.0 / 1.645
# Metres. Far mates hardly tell two places apart: the nearer, the better, at this many metres of spread each.
_NEAR, _SPREAD_PER_METRE = 0.70, 0.03
_MOST_MATES = 6
# A distance is off if it differs from the usual one by more than this many metres and standard deviations,
# which no bend of a joint and no skin explains.
_MIN_OFF, _MIN_OFF_SPREADS = 0.05, 5.0
_SAMPLED, _FEWEST_SAMPLES = 200, 20  # frames from which the usual distances are computed


@dataclass(frozen=True)
class Mates:
    """A marker's mates: their numbers (n,), and the usual distance and its tolerance (n,) to each, metres."""

    markers: NDArray[np.intp]
    usual: Array
    tolerance: Array

    def differences(self, place: Array, points: Array) -> Array:
        """Differences (F, n) in metres from the usual distances, of a marker at `place` (F, 3).

        points: (F, M, 3). NaN where the place or a mate is missing.
        """
        return np.asarray(np.abs(distances(points[:, self.markers], place[:, None]) - self.usual))

    def off(self, place: Array, points: Array, *, without: int) -> tuple[Array, NDArray[np.intp]]:
        """The share (F,) of the mates to which `place` is off, 0 if none is seen, and how many are seen (F,).

        without: a marker that is no mate here.
        """
        with_it = self.markers != without
        differences = self.differences(place, points)[:, with_it]
        seen = np.isfinite(differences).sum(axis=1)
        off = (np.isfinite(differences) & (differences > self.tolerance[with_it])).sum(axis=1)
        return off / np.maximum(seen, 1), seen


def mates_of(marker: int, points: Array) -> Mates:
    """The mates of a marker among points (T, M, 3), metres, NaN where missing."""
    sampled = points[:: max(1, len(points) // _SAMPLED)]
    distance = distances(sampled, sampled[:, marker, None])
    enough = np.isfinite(distance).sum(axis=0) >= min(_FEWEST_SAMPLES, len(sampled))
    enough[marker] = False
    candidates = np.flatnonzero(enough)
    known = distance[:, candidates]
    # With NaN, numpy takes many times as long.
    quantile = np.quantile if np.isfinite(known).all() else np.nanquantile
    usual = quantile(known, 0.5, axis=0)
    spread = _SD_OVER_QUANTILE * quantile(np.abs(known - usual), _QUANTILE, axis=0)
    order = np.argsort(spread + _SPREAD_PER_METRE * usual, kind="stable")
    order = order[(spread[order] < _MAX_SPREAD) & (usual[order] < _NEAR)][:_MOST_MATES]
    tolerance = np.maximum(_MIN_OFF, _MIN_OFF_SPREADS * spread[order])
    return Mates(candidates[order], usual[order], tolerance)
