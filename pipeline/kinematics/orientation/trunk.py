"""World frames of the pelvis and the torso, from the joints of the trunk.

The first axis of each is reliable (the hip line; the line from the spine to the shoulder centre); a second
line shows the turn about it. A depth sensor that sees a person from the side puts both shoulders, or both
hips, at nearly one point: the second line then points anywhere, even along the first.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.orientation.twist import FADE, follow_twist
from kinemimic.pipeline.kinematics.rotations import (
    conjugate,
    from_axis_angle,
    from_two_axes,
    multiply,
    normalize,
)
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N

_UP = np.array([0.0, 0.0, 1.0])
# Width over the median width above which a line is fully trusted; oblique views shrink it too.
_NARROW = 0.5


def direction(positions: Array, start: str, end: str) -> Array:
    """Unit vectors (T, 3) from one node to another, of positions (T, 20, 3); NaN where they coincide."""
    v = positions[:, N[end]] - positions[:, N[start]]
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    return np.asarray(v / np.where(length < 1e-6, np.nan, length))


def swing(start: Array, end: Array, furthest: float) -> Array:
    """The smallest rotation (T, 4) from unit vectors `start`, (3,) or (T, 3), to `end` (T, 3).

    NaN where its angle exceeds `furthest` (radians): near the opposite of `start` it is undefined.
    """
    cosine = np.sum(start * end, axis=-1, keepdims=True)
    q = np.concatenate([np.cross(start, end), 1.0 + cosine], axis=-1)
    return normalize(np.where(cosine > np.cos(furthest), q, np.nan))


def pelvis_frames(positions: Array) -> Array:
    """World frames (T, 4) of positions (T, 20, 3): Y to the left hip, Z as close to the spine as possible."""
    hips = direction(positions, "hip_right", "hip_left")
    waist, trunk = (direction(positions, "hip_center", end) for end in ("spine", "shoulder_center"))
    lying = np.abs(hips[:, 2:]) > 0.9
    upright = np.full((len(hips), 4), np.nan)
    good = np.isfinite(hips).all(axis=-1) & ~lying[:, 0]
    upright[good] = from_two_axes(hips[good], np.broadcast_to(_UP, hips[good].shape), "YZ")
    return _steady(hips, waist, trunk, upright, "YZ", np.ones(len(hips)))


def torso_frames(positions: Array) -> Array:
    """World frames (T, 4): Z from the spine to the shoulder centre, Y as close to the left as possible."""
    hips, shoulders = (direction(positions, f"{line}_right", f"{line}_left") for line in ("hip", "shoulder"))
    trunk = direction(positions, "spine", "shoulder_center")
    width = np.linalg.norm(positions[:, N["shoulder_left"]] - positions[:, N["shoulder_right"]], axis=-1)
    seen = np.isfinite(width)
    usual = float(np.median(width[seen])) if seen.any() else 1.0
    shown = np.clip(width / max(_NARROW * usual, 1e-6), 0.0, 1.0) ** 2
    return _steady(trunk, shoulders, hips, swing(_UP, trunk, np.radians(150.0)), "ZY", shown)


def _steady(first: Array, second: Array, helper: Array, upright: Array, names: str, shown: Array) -> Array:
    """World frames (T, 4): axis names[0] along unit vectors `first`, names[1] close to `second`.

    Where `second` is nearly in line with `first`, `helper` replaces it if finite. upright: (T, 4) frames with
    the same first axis, relative to which the turn is followed in time, NaN where undefined; shown: (T,) 0 to
    1, confidence in `second`. NaN where a direction is missing.
    """
    sine = np.linalg.norm(np.cross(first, second), axis=-1)
    doubt = np.clip(1.0 - (sine / (2.0 * FADE)) ** 2, 0.0, None)[:, None] ** 2
    helped = second + np.where(np.isfinite(helper), doubt * helper, 0.0)
    frames = np.full((len(first), 4), np.nan)
    good = np.linalg.norm(np.cross(first, helped), axis=-1) > 1e-6
    if not good.any():
        return frames
    frames[good] = from_two_axes(first[good], helped[good], names)
    turned = multiply(conjugate(upright), frames)
    angle = 2.0 * np.arctan2(turned[:, "XYZ".index(names[0])], turned[:, 3])
    turn = follow_twist(angle, sine * shown, np.stack([first, second], axis=1))
    followed = multiply(upright, from_axis_angle(names[0], turn))
    return np.where(np.isfinite(followed), followed, frames)
