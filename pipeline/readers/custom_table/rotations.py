"""Rotations of a custom table, in the form that its description gives, and the positions that follow."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.rotations import IDENTITY, conjugate, from_euler, multiply, rotate
from kinemimic.pipeline.kinematics.skeleton import Skeleton
from kinemimic.pipeline.readers.base.absolute_orientations import child_to_parent
from kinemimic.pipeline.readers.custom_table.description import Description

# Quaternions are written with few digits; a value of a length outside these limits is not one.
_UNIT = (0.9, 1.1)


@dataclass(frozen=True)
class Pose:
    """A pose per frame, in the file's axes made right-handed.

    positions: (T, J, 3) in the world; translations: (T, J, 3) in the parent's frame; rotations: (T, J, 4)
    child to parent; euler: (T, J, 3) radians and orders: (J,), if the file has Euler angles.
    """

    positions: Array
    translations: Array
    rotations: Array
    euler: Array | None
    orders: tuple[str, ...] | None


def pose_of(
    description: Description,
    skeleton: Skeleton,
    of_file: tuple[int, ...],
    points: Array,
    rotations_of_file: Array,
    mirrored: int | None,
) -> Pose:
    """Positions and rotations of a capture that has columns of rotations.

    points: (T, J, 3) metres, mirrored already; rotations_of_file: (T, J, 3 or 4) as in the file; both in the
    order of the skeleton's joints; of_file: as in Tree. mirrored: the axis that was flipped to make the file
    right-handed: a rotation about it keeps its sign, one about another axis changes it.
    """
    joints = [description.joints[k] for k in of_file]
    euler, orders = None, None
    if any(joint.euler for joint in joints):
        orders = tuple(description.turns.order if joint.euler else "" for joint in joints)
        euler = _euler(description, rotations_of_file, orders, mirrored)
        rotations = np.broadcast_to(IDENTITY, (*euler.shape[:2], 4)).copy()
        for j, order in enumerate(orders):
            if order:
                rotations[:, j] = from_euler(euler[:, j], order)
    else:
        rotations = _quaternions(description, rotations_of_file, mirrored)
    has_rotation = [bool(joint.euler or joint.quaternion) for joint in joints]
    if description.turns.relative_to == "world":
        for j, parent in enumerate(skeleton.parents):
            if not has_rotation[j]:
                rotations[:, j] = IDENTITY if parent < 0 else rotations[:, parent]
        rotations = child_to_parent(rotations, skeleton, IDENTITY)
        euler, orders = None, None
    else:
        rotations[:, [j for j, rotates in enumerate(has_rotation) if not rotates]] = IDENTITY
    has_position = [bool(joint.position) for joint in joints]
    positions, translations = np.empty_like(points), np.empty_like(points)
    world = np.empty_like(rotations)
    for j, parent in enumerate(skeleton.parents):
        given = points[:, j] if has_position[j] else np.broadcast_to(skeleton.offsets[j], points[:, j].shape)
        if parent < 0:
            positions[:, j], translations[:, j], world[:, j] = given, given, rotations[:, j]
            continue
        world[:, j] = multiply(world[:, parent], rotations[:, j])
        if has_position[j] and description.space.relative_to == "world":
            positions[:, j] = given
            translations[:, j] = rotate(conjugate(world[:, parent]), given - positions[:, parent])
        else:
            translations[:, j] = given
            positions[:, j] = positions[:, parent] + rotate(world[:, parent], given)
    return Pose(positions, translations, rotations, euler, orders)


def _euler(
    description: Description, rotations_of_file: Array, orders: tuple[str, ...], mirrored: int | None
) -> Array:
    """Radians (T, J, 3) in the sequence of the order; zeros for a joint without angles."""
    angles = np.radians(rotations_of_file) if description.turns.unit == "deg" else rotations_of_file.copy()
    if mirrored is not None:
        angles *= [1.0 if axis == "XYZ"[mirrored] else -1.0 for axis in description.turns.order]
    angles[:, [not order for order in orders]] = 0.0
    return angles


def _quaternions(description: Description, rotations_of_file: Array, mirrored: int | None) -> Array:
    """Unit quaternions (T, J, 4) as (x, y, z, w); NaN where the file has zeros or nothing."""
    q = (
        rotations_of_file[..., [1, 2, 3, 0]]
        if description.turns.order == "wxyz"
        else rotations_of_file.copy()
    )
    if mirrored is not None:
        q[..., [k for k in range(3) if k != mirrored]] *= -1.0
    length = np.linalg.norm(np.where(np.abs(q) < 1e6, q, np.nan), axis=-1, keepdims=True)
    q = np.where(length > 0, q / np.where(length > 0, length, 1.0), np.nan)
    lengths = length[length > 0]
    if lengths.size and not _UNIT[0] <= np.median(lengths) <= _UNIT[1]:
        raise CaptureError(
            description.path,
            expected="columns of quaternions, whose length is 1",
            found=f"a median length of {np.median(lengths):.3g}",
            where="key columns.quaternion",
        )
    return np.asarray(q)
