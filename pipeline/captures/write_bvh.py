"""Writes a skeleton with quaternions as BVH, in any of the six orders that BVH can name."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from kinemimic.pipeline.rotations import ORDERS, Y_UP_TO_Z_UP, conjugate, multiply, rotate
from kinemimic.pipeline.skeleton import Skeleton
from kinemimic.pipeline.store import write_text

Array = NDArray[np.float64]

# A joint has each of its channels once, so that proper Euler orders (ZXZ) cannot be written.
BVH_ORDERS: tuple[str, ...] = tuple(order for order in ORDERS if len(set(order)) == 3)
_DECIMALS = 6


def write_bvh(
    path: Path,
    skeleton: Skeleton,
    root: Array,
    rotations: Array,
    *,
    frame_time: float,
    order: str = "YZX",
    names: Sequence[str] | None = None,
    units_per_metre: float = 100.0,
) -> None:
    """Write T frames; BVH is Y up, so offsets, root and rotations are turned from our Z up.

    root: (T, 3) metres in the world; rotations: (T, J, 4) child to parent, finite; frame_time: seconds;
    order: the channels' sequence (YZX is the paper's Eq. 8); names: of the joints in the file, the
    skeleton's by default.
    Every joint has three rotation channels and a leaf an end site of no length.
    """
    angles = np.degrees(file_angles(rotations, order))
    offsets = units_per_metre * rotate(conjugate(Y_UP_TO_Z_UP), skeleton.offsets)
    columns = hierarchy_sequence(skeleton)
    places = units_per_metre * rotate(conjugate(Y_UP_TO_Z_UP), root)
    values = np.concatenate([places, angles[:, columns].reshape(len(root), -1)], axis=1)
    lines = ["HIERARCHY", *_joint(skeleton, offsets, names or skeleton.names, order, 0, 0)]
    lines += ["MOTION", f"Frames: {len(root)}", f"Frame Time: {frame_time:.8f}"]
    lines += [" ".join(_number(value) for value in row) for row in values]
    write_text(path, "\n".join(lines) + "\n")


def file_angles(rotations: Array, order: str) -> Array:
    """Euler angles (T, J, 3) in radians, in the sequence of `order`, about the file's Y-up axes."""
    if order not in BVH_ORDERS:
        raise ValueError(f"no order of BVH: {order!r}; the six are {', '.join(BVH_ORDERS)}")
    q = multiply(multiply(conjugate(Y_UP_TO_Z_UP), rotations), Y_UP_TO_Z_UP)
    with warnings.catch_warnings():
        # At exact lock scipy picks one of the equal triples and says so; the rotation written is right.
        warnings.simplefilter("ignore", UserWarning)
        angles = Rotation.from_quat(q.reshape(-1, 4)).as_euler(cast(Any, order))
    return np.asarray(angles).reshape(*q.shape[:-1], 3)


def hierarchy_sequence(skeleton: Skeleton) -> list[int]:
    """Joints in the sequence in which a hierarchy names them: depth first."""
    sequence: list[int] = []
    pending = [0]
    while pending:
        joint = pending.pop()
        sequence.append(joint)
        pending += reversed([child for child, parent in enumerate(skeleton.parents) if parent == joint])
    return sequence


def _joint(
    skeleton: Skeleton, offsets: Array, names: Sequence[str], order: str, joint: int, depth: int
) -> list[str]:
    """Lines of a joint and all below it."""
    tab = "\t" * depth
    turns = " ".join(f"{axis}rotation" for axis in order)
    channels = f"6 Xposition Yposition Zposition {turns}" if depth == 0 else f"3 {turns}"
    kind = "ROOT" if depth == 0 else "JOINT"
    lines = [f"{tab}{kind} {names[joint]}", f"{tab}{{", f"{tab}\tOFFSET {_row(offsets[joint])}"]
    lines.append(f"{tab}\tCHANNELS {channels}")
    children = [child for child, parent in enumerate(skeleton.parents) if parent == joint]
    for child in children:
        lines += _joint(skeleton, offsets, names, order, child, depth + 1)
    if not children:
        lines += [f"{tab}\tEnd Site", f"{tab}\t{{", f"{tab}\t\tOFFSET {_row(np.zeros(3))}", f"{tab}\t}}"]
    return [*lines, f"{tab}}}"]


def _row(values: Array) -> str:
    return " ".join(_number(value) for value in values)


def _number(value: float) -> str:
    text = f"{value:.{_DECIMALS}f}"
    return text[1:] if text.strip("-0.") == "" and text.startswith("-") else text
