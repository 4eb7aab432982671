"""A capture's Euler channels, whole skeletons at a time, to local quaternions and world positions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.clip import forward_kinematics
from kinemimic.pipeline.rotations import IDENTITY, continuous, from_euler, from_euler_eq8, multiply, rotate
from kinemimic.pipeline.skeleton import Skeleton

Array = NDArray[np.float64]

# The paper's Eq. 8 as printed is this intrinsic order (see rotations.from_euler_eq8).
EQ8_ORDER = "YZX"


def order_name(order: str) -> str:
    """An order as reports name it: YZX is also the paper's Eq. 8."""
    return f"{order} (Eq. 8)" if order == EQ8_ORDER else order


def local_rotations(
    euler: Array, orders: tuple[str, ...], world_from_file: Array, rests: Array | None = None
) -> Array:
    """Quaternions (T, J, 4), child to parent, sign-continuous; the root's (joint 0) in our world.

    euler: (T, J, 3) radians in the sequence of orders (J,); "" is a joint without rotation channels.
    rests: (J, 4) as in Clip; a joint's rotation is its rest's times that of its channels.
    """
    rotations = np.broadcast_to(IDENTITY, (*euler.shape[:2], 4)).copy()
    for joint, order in enumerate(orders):
        if order == EQ8_ORDER:
            rotations[:, joint] = from_euler_eq8(euler[:, joint])
        elif order:
            rotations[:, joint] = from_euler(euler[:, joint], order)
    if rests is not None:
        rotations = multiply(rests, rotations)
    rotations[:, 0] = multiply(world_from_file, rotations[:, 0])
    return continuous(rotations)


def world_positions(
    skeleton: Skeleton, translations: Array, rotations: Array, world_from_file: Array
) -> Array:
    """Positions (T, J, 3) in our world.

    translations: (T, J, 3), the root's (joint 0) in the file's world; rotations: as from `local_rotations`.
    """
    moved = translations.copy()
    moved[:, 0] = rotate(world_from_file, moved[:, 0])
    return forward_kinematics(skeleton, moved, rotations)[0]
