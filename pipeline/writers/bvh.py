"""Writes BVH: poses, in any order that BVH can name, or a clip's own channels."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np
from scipy.spatial.transform import Rotation

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.files.store import write_text
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import ORDERS, Y_UP_TO_Z_UP, conjugate, multiply, rotate
from kinemimic.pipeline.kinematics.skeleton import Skeleton
from kinemimic.pipeline.writers.poses import Poses

# A joint has each of its channels once, so that proper Euler orders (ZXZ) cannot be written.
BVH_ORDERS: tuple[str, ...] = tuple(order for order in ORDERS if len(set(order)) == 3)
_DECIMALS = 6
_PLACES = ("Xposition", "Yposition", "Zposition")
# Metres and sines of half angles; below lies the rounding of what does not move.
_STILL = 1e-9


def write_bvh(path: Path, poses: Poses, *, order: str = "YZX", units_per_metre: float = 100.0) -> None:
    """Write poses; BVH is Y up, so offsets, places and rotations are turned from our Z up.

    order: the channels' sequence (YZX is the paper's Eq. 8). Every joint has three rotation channels, one
    that moves in its parent position channels before them, which take the place of its offset; a leaf has an
    end site of no length. Leaves that only end their parent (`<parent>_end`) become end sites.
    """
    back = conjugate(Y_UP_TO_Z_UP)
    skeleton = poses.skeleton
    turns = tuple(f"{axis}rotation" for axis in order)
    moves = np.abs(poses.translations - skeleton.offsets).max(axis=(0, 2)) > _STILL
    moves[0] = True
    turned = np.abs(poses.rotations[..., :3]).max(axis=(0, 2)) > _STILL
    channels = [
        () if _ends(skeleton, joint) and not (moves[joint] or turned[joint])
        else (*(_PLACES if moves[joint] else ()), *turns)
        for joint in range(len(skeleton.names))
    ]  # fmt: skip
    names = tuple("_".join(name.split()) for name in skeleton.names)
    _write(
        path,
        Skeleton(names, skeleton.parents, units_per_metre * rotate(back, skeleton.offsets)),
        channels,
        units_per_metre * rotate(back, poses.translations),
        np.degrees(file_angles(poses.rotations, order)),
        1.0 / poses.rate,
    )


def write_bvh_channels(path: Path, clip: Clip, *, units_per_metre: float = 100.0) -> None:
    """Write a clip of Euler channels as it was read: its own joints, orders, angles and offsets.

    Joints without rotation channels whose names are those of end sites (`<parent>_end`) become end sites;
    joints that move in their parents get position channels. The clock is even, at the clip's rate.
    ValueError for a clip without channels, in other axes than BVH's, or with an order that BVH cannot name.
    """
    if clip.euler is None or clip.orders is None or clip.translations is None:
        raise ValueError("the clip has no Euler channels")
    if clip.rests is not None or not np.allclose(clip.world_from_file, Y_UP_TO_Z_UP):
        raise ValueError("the clip's joints are not framed as BVH frames them")
    for order in set(clip.orders) - {"", *BVH_ORDERS}:
        raise ValueError(f"no order of BVH: {order!r}; the six are {', '.join(BVH_ORDERS)}")
    skeleton = clip.skeleton
    moves = (clip.translations != skeleton.offsets).any(axis=(0, 2))
    moves[0] = True
    channels = [
        (*(_PLACES if moved else ()), *(f"{axis}rotation" for axis in order))
        for moved, order in zip(moves, clip.orders, strict=True)
    ]
    offsets = Skeleton(skeleton.names, skeleton.parents, units_per_metre * skeleton.offsets)
    places = units_per_metre * clip.translations
    _write(path, offsets, channels, places, np.degrees(clip.euler), 1.0 / clip.rate)


def _write(
    path: Path,
    skeleton: Skeleton,
    channels: Sequence[tuple[str, ...]],
    places: Array,
    angles: Array,
    frame_time: float,
) -> None:
    """Write joints with `channels` (J,), the places (T, J, 3) and angles (T, J, 3) in the file's units."""
    columns = []
    for joint in hierarchy_sequence(skeleton):
        turns = iter(np.moveaxis(angles[:, joint], -1, 0))
        for channel in channels[joint]:
            moved = channel in _PLACES
            columns.append(places[:, joint, _PLACES.index(channel)] if moved else next(turns))
    lines = ["HIERARCHY", *_joint(skeleton, channels, 0, 0)]
    lines += ["MOTION", f"Frames: {len(places)}", f"Frame Time: {frame_time:.8f}"]
    lines += [" ".join(_number(value) for value in row) for row in np.stack(columns, axis=-1)]
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


def _joint(skeleton: Skeleton, channels: Sequence[tuple[str, ...]], joint: int, depth: int) -> list[str]:
    """Lines of a joint and all below it."""
    tab = "\t" * depth
    name = skeleton.names[joint]
    children = [child for child, parent in enumerate(skeleton.parents) if parent == joint]
    end = not channels[joint] and _ends(skeleton, joint)
    kind = "End Site" if end else f"ROOT {name}" if depth == 0 else f"JOINT {name}"
    lines = [f"{tab}{kind}", f"{tab}{{", f"{tab}\tOFFSET {_row(skeleton.offsets[joint])}"]
    if not end:
        lines.append(f"{tab}\tCHANNELS {' '.join([str(len(channels[joint])), *channels[joint]])}")
        for child in children:
            lines += _joint(skeleton, channels, child, depth + 1)
        if not children and channels[joint]:
            # Other programs expect an end of every limb that turns.
            lines += [f"{tab}\tEnd Site", f"{tab}\t{{", f"{tab}\t\tOFFSET {_row(np.zeros(3))}", f"{tab}\t}}"]
    return [*lines, f"{tab}}}"]


def _ends(skeleton: Skeleton, joint: int) -> bool:
    """Whether a joint is a leaf with the name that an end site has in a clip."""
    parent = skeleton.parents[joint]
    return (
        parent >= 0
        and joint not in skeleton.parents
        and skeleton.names[joint].startswith(f"{skeleton.names[parent]}_end")
    )


def _row(values: Array) -> str:
    return " ".join(_number(value) for value in values)


def _number(value: float) -> str:
    text = f"{value:.{_DECIMALS}f}"
    return text[1:] if text.strip("-0.") == "" and text.startswith("-") else text
