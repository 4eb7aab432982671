"""The turn of a bone about itself, followed through time.

Two points give a bone's direction; its turn about that direction shows only in what is joined to it: a bent
elbow shows the upper arm's, the line of the shoulders the trunk's. Where that is nearly in line with the bone
itself it shows mere noise, and in line nothing at all. No rule for single frames can bridge that without a
leap somewhere (the bends around a straight arm form a circle, and a circle cannot be drawn together to a
point). So the turn is carried over from where it was seen: of all courses the one that keeps to what was
seen, weighted by how well it was, and changes little where the body moved little.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import solveh_banded

from kinemimic.pipeline.arrays import Array

# Sine of the angle to the bone at which what shows the turn is as good as nothing: a sensor that puts a wrist
# 3 cm aside bends a straight arm by that.
FADE = 0.15
# Turn per angle by which the bones themselves moved, at most; and the angle, in radians, below which they
# have not moved, and beyond which in one step the body was lost and found: nothing is carried over.
_LIVELY, _STILL, _LOST = 2.0, 0.01, 1.6
# Keeps the tangent of a right angle finite.
_RIGHT = 1e-6
# Weight of no turn at all: it decides only for a limb that is straight for long.
_NEUTRAL = 0.05


def follow_twist(seen: Array, sine: Array, directions: Array) -> Array:
    """The turn (T,) in radians, as near as can be to `seen` (T,), without leaps; NaN where `seen` is.

    sine: (T,) of the angle between the bone and what shows its turn, 0 shows nothing; directions: (T, k, 3)
    unit vectors of both, in the frame of what carries the bone: how far they move says how far the turn may.
    First a weighted least-squares course, a tridiagonal system in two rounds: on the circle, which tells how
    many times round each angle has gone, then on the line. Then the bound, which leaves alone what keeps it:
    halfway between the least course above and the greatest below that turn no faster.
    """
    known = np.flatnonzero(np.isfinite(seen) & np.isfinite(directions).all(axis=(1, 2)))
    turn = np.full(len(seen), np.nan)
    if len(known) < 2:
        turn[known] = seen[known]
        return turn
    moved = np.sqrt(np.sum(np.diff(directions[known], axis=0) ** 2, axis=-1).max(axis=-1))
    free = _LIVELY * np.maximum(moved, _STILL)
    shown = sine[known] ** 2 / (FADE**2 * (1.0 - sine[known] ** 2 + _RIGHT))
    course = _least_squares(seen[known], shown**2, free, moved)
    # Where the body was lost the bound is off: no course turns further than all of it.
    reach = np.where(moved < _LOST, free, 2.0 * np.ptp(course))
    turn[known] = 0.5 * (_bounded(course, reach) - _bounded(-course, reach))
    return turn


def _least_squares(angle: Array, weight: Array, free: Array, moved: Array) -> Array:
    """The course (n,) that keeps to angles (n,) by their weights, changing by about `free` (n - 1,)."""
    stiff = np.clip(1.0 - (moved / _LOST) ** 2, 0.0, None) ** 2 / free**2
    band = np.zeros((2, len(angle)))
    band[0, 1:] = -stiff
    band[1] = weight + _NEUTRAL
    band[1, 1:] += stiff
    band[1, :-1] += stiff
    circle = np.stack([weight * np.cos(angle) + _NEUTRAL, weight * np.sin(angle)], axis=-1)
    around = solveh_banded(band, circle)
    course = np.unwrap(np.arctan2(around[:, 1], around[:, 0]))
    turns = [2.0 * np.pi * np.round((course - one) / (2.0 * np.pi)) for one in (angle, 0.0)]
    return np.asarray(solveh_banded(band, weight * (angle + turns[0]) + _NEUTRAL * turns[1]))


def _bounded(course: Array, reach: Array) -> Array:
    """The greatest course (n,) not above `course` that changes by `reach` (n - 1,) a step at most."""
    way = np.concatenate([[0.0], np.cumsum(reach)])
    ahead = np.minimum.accumulate(course - way) + way
    return np.asarray(np.minimum.accumulate((ahead + way)[::-1])[::-1] - way)
