"""Angles that a format has in degrees, and a file in radians."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.quality.rules.defect import Defect

# Share of the angles that may be larger than half a turn in radians: those of unwrapped channels.
_LARGER = 1.0
# As numbers, by which some joint turns; and as a share of the body's size, by which the body moves.
_TURNED, _MOVED = 0.3, 0.25


def radians_defect(angles: Array, positions: Array) -> Defect | None:
    """A defect if the angles of a file's joints, which should be degrees, are radians.

    angles: (T, J - 1, 3) as in the file, of all joints but the root; positions: (T, J, 3) in any unit, read
    in degrees. None of the joints would ever be bent by more than three, while the body as a whole moves:
    nobody does that.
    """
    used = angles[:, (angles != 0.0).any(axis=0)]
    if not used.size:
        return None
    largest = float(np.percentile(np.abs(used), 100.0 - _LARGER))
    turned = float(np.ptp(np.percentile(used, [5.0, 95.0], axis=0), axis=0).max())
    size = float(np.linalg.norm(positions - positions[:, :1], axis=-1).max())
    moved = float(np.ptp(positions[:, 0], axis=0).max())
    if largest > np.pi or turned < _TURNED or moved < _MOVED * size:
        return None
    text = f"the angles are radians: as degrees, none of the moving body exceeds {largest:.1f}"
    return Defect("wrong_units", angles.shape[1], "joints", "repaired", text)
