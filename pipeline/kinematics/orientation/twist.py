"""Follow the twist of a bone, its rotation about its own axis, through time.

Two points give a bone's direction; its twist shows only in the segments attached to it: a bent elbow shows
the upper arm's, the shoulder line the trunk's. If such a segment is nearly in line with the bone, it shows
only noise; if it is exactly in line, nothing. No rule for single frames can bridge this without a jump
somewhere (the bends around a straight arm form a circle, which cannot be contracted to a point). So the twist
is carried over from frames that show it: the curve follows the observed twist, weighted by how well it is
seen, and changes little where the body moves little.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import solveh_banded

from kinemimic.pipeline.arrays import Array

# Sine of the angle to the bone below which the observed twist is mostly noise: a wrist that the sensor puts
# 3 cm aside bends a straight arm by that much.
FADE = 0.15
# Most twist per angle that the bones themselves moved; the angle (radians) below which they count as still;
# and the angle in one step beyond which tracking was lost, so that nothing is carried over.
_LIVELY, _STILL, _LOST = 2.0, 0.01, 1.6
# Keeps the tangent finite at a right angle.
_RIGHT = 1e-6
# Weight of zero twist: it matters only for a limb that stays straight for long.
_NEUTRAL = 0.05


def follow_twist(seen: Array, sine: Array, directions: Array) -> Array:
    """The twist (T,) in radians, as close to `seen` (T,) as possible without jumps; NaN where `seen` is NaN.

    sine: (T,) of the angle between the bone and the line that shows its twist, 0 shows nothing; directions:
    (T, k, 3) unit vectors of both, in the frame of the parent: how far they move limits how far the twist may
    change. First a weighted least-squares curve, a tridiagonal system solved twice: on the circle, to unwrap
    the angles, then on the line. Then the rate limit: the mean of the lowest curve above and the highest
    curve below that change no faster; a curve within the limit is unchanged.
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
    # Where tracking was lost there is no limit: no curve turns further than its whole range.
    reach = np.where(moved < _LOST, free, 2.0 * np.ptp(course))
    turn[known] = 0.5 * (_bounded(course, reach) - _bounded(-course, reach))
    return turn


def _least_squares(angle: Array, weight: Array, free: Array, moved: Array) -> Array:
    """The curve (n,) that fits angles (n,) by their weights and changes by about `free` (n - 1,)."""
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
    """The highest curve (n,) not above `course` that changes by at most `reach` (n - 1,) per step."""
    total = np.concatenate([[0.0], np.cumsum(reach)])
    ahead = np.minimum.accumulate(course - total) + total
    return np.asarray(np.minimum.accumulate((ahead + total)[::-1])[::-1] - total)
