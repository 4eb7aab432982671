"""Rotations as quaternions (x, y, z, w), child to parent, on arrays of any leading shape.

Euler angles are in radians; an order such as "ZYX" is intrinsic (turn about Z, then about the new Y, then
about the newest X), so that R = Rz(a) Ry(b) Rx(c).
"""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]

ORDERS: tuple[str, ...] = tuple(
    "".join(axes) for axes in product("XYZ", repeat=3) if axes[0] != axes[1] and axes[1] != axes[2]
)
IDENTITY: Array = np.array([0.0, 0.0, 0.0, 1.0])
# Y up, Z forward, X left (BVH, Kinect) to Z up, X forward, Y left: the cyclic change of axes.
Y_UP_TO_Z_UP: Array = np.array([0.5, 0.5, 0.5, 0.5])
_AXIS = {"X": 0, "Y": 1, "Z": 2}


def multiply(p: Array, q: Array) -> Array:
    """Hamilton product p q: first q, then p."""
    px, py, pz, pw = np.moveaxis(np.asarray(p), -1, 0)
    qx, qy, qz, qw = np.moveaxis(np.asarray(q), -1, 0)
    return np.stack(
        [
            pw * qx + px * qw + py * qz - pz * qy,
            pw * qy - px * qz + py * qw + pz * qx,
            pw * qz + px * qy - py * qx + pz * qw,
            pw * qw - px * qx - py * qy - pz * qz,
        ],
        axis=-1,
    )


def conjugate(q: Array) -> Array:
    """Inverse of a unit quaternion."""
    conjugated: Array = np.asarray(q, dtype=np.float64) * np.array([-1.0, -1.0, -1.0, 1.0])
    return conjugated


def rotate(q: Array, v: Array) -> Array:
    """Vectors v (..., 3) turned by q (..., 4)."""
    q, v = np.asarray(q, dtype=np.float64), np.asarray(v, dtype=np.float64)
    xyz, w = q[..., :3], q[..., 3:]
    t = 2.0 * np.cross(xyz, v)
    turned: Array = v + w * t + np.cross(xyz, t)
    return turned


def normalize(q: Array) -> Array:
    """Quaternions of unit length."""
    unit: Array = q / np.linalg.norm(q, axis=-1, keepdims=True)
    return unit


def from_axis_angle(axis: str, angle: Array | float) -> Array:
    """Turn about a coordinate axis "X", "Y" or "Z" by an angle in radians."""
    half = 0.5 * np.asarray(angle, dtype=np.float64)
    q = np.zeros((*half.shape, 4))
    q[..., _AXIS[axis]] = np.sin(half)
    q[..., 3] = np.cos(half)
    return q


def from_euler(angles: Array, order: str) -> Array:
    """Intrinsic Euler angles (..., 3) in the sequence of `order` to quaternions (..., 4)."""
    if order not in ORDERS:
        raise ValueError(f"unknown Euler order {order!r}; the twelve are {', '.join(ORDERS)}")
    angles = np.asarray(angles, dtype=np.float64)
    turns = [from_axis_angle(axis, angles[..., k]) for k, axis in enumerate(order)]
    return multiply(multiply(turns[0], turns[1]), turns[2])


def from_euler_eq8(theta: Array) -> Array:
    """The paper's Eq. 8 as printed: angles (..., 3) = (θ1, θ2, θ3) to quaternions (a, b, c, w).

    Written out, the four lines are q_y(θ1) q_z(θ2) q_x(θ3): the intrinsic order YZX, although the text
    names the axes x, y, z.
    """
    half = 0.5 * np.asarray(theta, dtype=np.float64)
    (c1, c2, c3), (s1, s2, s3) = (np.moveaxis(f(half), -1, 0) for f in (np.cos, np.sin))
    return np.stack(
        [
            c1 * c2 * s3 + s1 * s2 * c3,
            c1 * s2 * s3 + s1 * c2 * c3,
            -s1 * c2 * s3 + c1 * s2 * c3,
            -s1 * s2 * s3 + c1 * c2 * c3,
        ],
        axis=-1,
    )


def to_matrix(q: Array) -> Array:
    """Rotation matrices (..., 3, 3)."""
    x, y, z, w = np.moveaxis(np.asarray(q), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def from_matrix(matrix: Array) -> Array:
    """Quaternions of rotation matrices (..., 3, 3)."""
    matrix = np.asarray(matrix, dtype=np.float64)
    return np.asarray(Rotation.from_matrix(matrix.reshape(-1, 3, 3)).as_quat()).reshape(*matrix.shape[:-2], 4)


def to_rotvec(q: Array) -> Array:
    """Rotation vectors (..., 3), angle in [0, π]."""
    q = np.asarray(q)
    q = np.where(q[..., 3:] < 0, -q, q)
    sine = np.linalg.norm(q[..., :3], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, q[..., 3:])
    scale = np.where(sine > 1e-9, angle / np.where(sine > 1e-9, sine, 1.0), 2.0)
    return np.asarray(scale * q[..., :3])


def from_rotvec(v: Array) -> Array:
    """Quaternions of rotation vectors (..., 3)."""
    v = np.asarray(v, dtype=np.float64)
    angle = np.linalg.norm(v, axis=-1, keepdims=True)
    scale = np.where(angle > 1e-9, np.sin(0.5 * angle) / np.where(angle > 1e-9, angle, 1.0), 0.5)
    return np.concatenate([scale * v, np.cos(0.5 * angle)], axis=-1)


def continuous(q: Array, axis: int = 0) -> Array:
    """The same rotations with signs chosen so that neighbours along `axis` have a non-negative product.

    Frames with a NaN are passed over as they are: the sign carries across them.
    """
    q = np.moveaxis(np.array(q, dtype=np.float64), axis, 0)
    known = np.asarray(~np.isnan(q).any(axis=-1))
    before = q[:-1]
    if not known.all():
        frames = np.arange(len(q)).reshape(-1, *(1,) * (known.ndim - 1))
        last = np.maximum.accumulate(np.where(known, frames, 0), axis=0)[:-1]
        before = np.take_along_axis(q, last[..., None], axis=0)
    product = np.einsum("...i,...i->...", q[1:], before)
    # A change of sign turns every later frame, so the signs are a running product; NaN compares as none.
    flips = np.where(product < 0.0, -1.0, 1.0)
    q[1:] *= np.where(known[1:], np.cumprod(flips, axis=0), 1.0)[..., None]
    return np.moveaxis(q, 0, axis)


def angle_between(p: Array, q: Array) -> Array:
    """Angle of the rotation from p to q, in [0, π]."""
    return np.asarray(np.linalg.norm(to_rotvec(multiply(conjugate(p), q)), axis=-1))


def to_six(q: Array) -> Array:
    """The first two columns of the rotation matrix, (..., 6): the continuous form for observations."""
    m = to_matrix(q)
    return np.concatenate([m[..., :, 0], m[..., :, 1]], axis=-1)


def from_two_axes(primary: Array, secondary: Array, names: str) -> Array:
    """Frames whose axis names[0] is along `primary` and whose axis names[1] is as near `secondary` as can be.

    primary, secondary: (..., 3), need not be unit or orthogonal; names: two of "XYZ", e.g. "ZY".
    """
    first = primary / np.linalg.norm(primary, axis=-1, keepdims=True)
    second = secondary - np.sum(secondary * first, axis=-1, keepdims=True) * first
    second = second / np.linalg.norm(second, axis=-1, keepdims=True)
    a, b = _AXIS[names[0]], _AXIS[names[1]]
    third = np.cross(first, second) if (b - a) % 3 == 1 else np.cross(second, first)
    columns: list[Any] = [None, None, None]
    columns[a], columns[b], columns[3 - a - b] = first, second, third
    return from_matrix(np.stack(columns, axis=-1))
