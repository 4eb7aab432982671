"""The arrays of an SMPL body's motion by the names that programs give them, and its rotations in any shape.

AMASS stores poses, or root_orient and pose_body; programs that find the body in videos, and the libraries of
SMPL-X, store global_orient and body_pose, the latter often as matrices. The body's joints come first in all.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import from_matrix, to_rotvec
from kinemimic.pipeline.readers.base.source import Source

# The root and the body's joints, of which all have 22; SMPL has two more, SMPL+H and SMPL-X fingers and face.
BODY = 22
COUNTS = (BODY, 24, 52, 55)
# What is in the world comes before what is in the camera's axes.
_WHOLE: tuple[str, ...] = ("poses", "pose_world", "pose", "fullpose", "smpl_pose", "smpl_poses", "thetas")
_ROOT: tuple[str, ...] = ("root_orient", "global_orient", "root_pose")
_PARTS: tuple[str, ...] = ("pose_body", "body_pose")
_PATH: tuple[str, ...] = ("trans_world", "trans", "transl", "translation", "smpl_trans")
# Largest difference of a rotation matrix times its transpose from the identity.
_NOT_A_ROTATION = 0.01


class SmplArrays(NamedTuple):
    """Names of arrays: rotations, of all joints or of the root and the others; path, of the root."""

    rotations: tuple[str, ...]
    path: str


def smpl_arrays(names: Collection[str]) -> SmplArrays | None:
    """Which of an archive's arrays are the rotations and the path of a body; None if they are not there."""
    whole, root, parts, path = (
        next((name for name in known if name in names), None) for known in (_WHOLE, _ROOT, _PARTS, _PATH)
    )
    if path is None:
        return None
    if whole is not None:
        return SmplArrays((whole,), path)
    return None if root is None or parts is None else SmplArrays((root, parts), path)


def turns(arrays: dict[str, Array], names: SmplArrays, source: Source) -> Array:
    """Axis-angle vectors (T, 22, 3) of the body's joints, radians.

    arrays: those of `names`, of axis-angle vectors (T, J, 3) or (T, 3 J) or rotation matrices (T, J, 3, 3).
    CaptureError for other shapes.
    """
    if len(names.rotations) == 1:
        (name,) = names.rotations
        return vectors(arrays[name], name, COUNTS, source)[:, :BODY]
    root, parts = names.rotations
    of_root = vectors(arrays[root], root, (1,), source)
    of_parts = vectors(arrays[parts], parts, tuple(count - 1 for count in COUNTS), source)
    if len(of_root) != len(of_parts):
        raise source.error(
            expected=f"as many frames in {parts} as in {root}, {len(of_root)}", found=f"{len(of_parts)}"
        )
    return np.concatenate([of_root, of_parts], axis=1)[:, :BODY]


def path_of(arrays: dict[str, Array], names: SmplArrays, frames: int, source: Source) -> Array:
    """The path (T, 3) that belongs to rotations of this many frames; CaptureError for another shape."""
    path = numbers(arrays[names.path], names.path, source)
    if path.shape == (frames, 1, 3):
        path = path[:, 0]
    if path.shape != (frames, 3):
        raise source.error(
            expected=f"{names.path} of shape ({frames}, 3), as {names.rotations[0]}", found=f"{path.shape}"
        )
    return path


def numbers(array: Array, name: str, source: Source) -> Array:
    """The array in double precision; CaptureError for anything but numbers."""
    if array.dtype.kind not in "fiu":
        raise source.error(expected=f"numbers in {name}", found=f"{array.dtype}")
    return np.asarray(array, dtype=np.float64)


def vectors(array: Array, name: str, counts: tuple[int, ...], source: Source) -> Array:
    """Axis-angle vectors (T, J, 3), J one of `counts`, of an array as in `turns`; CaptureError for others."""
    values = numbers(array, name, source)
    are_matrices = values.ndim >= 3 and values.shape[-2:] == (3, 3)
    last = (3, 3) if are_matrices else (3,)
    if are_matrices or values.ndim == 2 or (values.ndim == 3 and values.shape[2] == 3):
        count, rest = divmod(values[:1].size, int(np.prod(last)))
        if len(values) and not rest and count in counts:
            turned = values.reshape(len(values), count, *last)
            return to_rotvec(_quaternions(turned, name, source)) if are_matrices else turned
    widths = ", ".join(str(3 * count) for count in counts)
    raise source.error(
        expected=f"{name} of shape (frames, {widths})", found=f"{array.shape}",
        advice="or as vectors (frames, joints, 3), or as matrices (frames, joints, 3, 3)",
    )  # fmt: skip


def _quaternions(matrices: Array, name: str, source: Source) -> Array:
    with np.errstate(invalid="ignore", over="ignore"):  # a damaged file may hold any number
        square = np.einsum("tjik,tjil->tjkl", matrices, matrices)
        wrong = ~(np.abs(square - np.eye(3)).max(axis=(2, 3)) < _NOT_A_ROTATION)  # NaN too
        wrong |= ~(np.linalg.det(np.where(wrong[..., None, None], 0.0, matrices)) > 0.0)
    if wrong.any():
        frame, joint = (int(k) for k in np.argwhere(wrong)[0])
        raise source.error(
            expected=f"rotation matrices in {name}",
            found=f"none at joint {joint}",
            where=f"frame {frame}",
        )
    return from_matrix(matrices)
