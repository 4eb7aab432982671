"""Write poses as BVH, in any Euler order that BVH supports."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.files.store import write_text
from kinemimic.pipeline.kinematics.euler_curves import principal_angles
from kinemimic.pipeline.kinematics.rotations import ORDERS, Y_UP_TO_Z_UP, conjugate, multiply, rotate
from kinemimic.pipeline.kinematics.skeleton import Skeleton
from kinemimic.pipeline.writers.poses import Poses

# Each channel occurs once per joint, so proper Euler orders (ZXZ) cannot be written.
BVH_ORDERS: tuple[str, ...] = tuple(order for order in ORDERS if len(set(order)) == 3)
_DECIMALS = 6
_UNITS_PER_METRE = 100.0
POSITION_CHANNELS = ("Xposition", "Yposition", "Zposition")
# Rounding error of joints that do not move (metres, sines of half angles).
_ROUNDING = 1e-9


def write_bvh(path: Path, poses: Poses, *, order: str = "YZX") -> None:
    """Write poses in centimetres; BVH is Y up, so offsets, positions and rotations are converted from our Z
    up.

    order: the order of the channels (YZX is the paper's Eq. 8). Every joint has three rotation channels;
    joints that move relative to their parents also get position channels before them, which replace the
    offset. A leaf gets an end site of zero length; leaves that only end their parent (`<parent>_end`) become
    end sites.
    """
    file_from_world = conjugate(Y_UP_TO_Z_UP)
    skeleton = poses.skeleton
    rotation_channels = tuple(f"{axis}rotation" for axis in order)
    has_translation = np.abs(poses.translations - skeleton.offsets).max(axis=(0, 2)) > _ROUNDING
    has_translation[0] = True
    has_rotation = np.abs(poses.rotations[..., :3]).max(axis=(0, 2)) > _ROUNDING
    channels = [
        () if _is_end_site(skeleton, joint) and not (has_translation[joint] or has_rotation[joint])
        else (*(POSITION_CHANNELS if has_translation[joint] else ()), *rotation_channels)
        for joint in range(len(skeleton.names))
    ]  # fmt: skip
    names = tuple("_".join(name.split()) for name in skeleton.names)
    write_hierarchy(
        path,
        Skeleton(names, skeleton.parents, _UNITS_PER_METRE * rotate(file_from_world, skeleton.offsets)),
        channels,
        _UNITS_PER_METRE * rotate(file_from_world, poses.translations),
        np.degrees(file_angles(poses.rotations, order)),
        1.0 / poses.rate,
    )


def write_hierarchy(
    path: Path,
    skeleton: Skeleton,
    channels: Sequence[tuple[str, ...]],
    positions: Array,
    angles: Array,
    frame_time: float,
) -> None:
    """Write joints with `channels` (J,), positions (T, J, 3) and angles (T, J, 3) in the file's units."""
    columns = []
    for joint in hierarchy_sequence(skeleton):
        rotation_channels = iter(np.moveaxis(angles[:, joint], -1, 0))
        for channel in channels[joint]:
            if channel in POSITION_CHANNELS:
                columns.append(positions[:, joint, POSITION_CHANNELS.index(channel)])
            else:
                columns.append(next(rotation_channels))
    lines = ["HIERARCHY", *_joint(skeleton, channels, 0, 0)]
    lines += ["MOTION", f"Frames: {len(positions)}", f"Frame Time: {frame_time:.8f}"]
    lines += [" ".join(_number(value) for value in row) for row in np.stack(columns, axis=-1)]
    write_text(path, "\n".join(lines) + "\n")


def file_angles(rotations: Array, order: str) -> Array:
    """Euler angles (T, J, 3) in radians, in the sequence of `order`, about the file's Y-up axes."""
    if order not in BVH_ORDERS:
        raise ValueError(f"not an Euler order of BVH: {order!r}; the six are {', '.join(BVH_ORDERS)}")
    q = multiply(multiply(conjugate(Y_UP_TO_Z_UP), rotations), Y_UP_TO_Z_UP)
    return principal_angles(q, order)


def hierarchy_sequence(skeleton: Skeleton) -> list[int]:
    """Joints in the order of a hierarchy: depth first."""
    sequence: list[int] = []
    pending = [0]
    while pending:
        joint = pending.pop()
        sequence.append(joint)
        pending += reversed([child for child, parent in enumerate(skeleton.parents) if parent == joint])
    return sequence


def _joint(skeleton: Skeleton, channels: Sequence[tuple[str, ...]], joint: int, depth: int) -> list[str]:
    """Lines of a joint and all its descendants."""
    tab = "\t" * depth
    name = skeleton.names[joint]
    children = [child for child, parent in enumerate(skeleton.parents) if parent == joint]
    end = not channels[joint] and _is_end_site(skeleton, joint)
    kind = "End Site" if end else f"ROOT {name}" if depth == 0 else f"JOINT {name}"
    lines = [f"{tab}{kind}", f"{tab}{{", f"{tab}\tOFFSET {_row(skeleton.offsets[joint])}"]
    if not end:
        lines.append(f"{tab}\tCHANNELS {' '.join([str(len(channels[joint])), *channels[joint]])}")
        for child in children:
            lines += _joint(skeleton, channels, child, depth + 1)
        if not children and channels[joint]:
            # Other programs expect an end site on every limb.
            lines += [f"{tab}\tEnd Site", f"{tab}\t{{", f"{tab}\t\tOFFSET {_row(np.zeros(3))}", f"{tab}\t}}"]
    return [*lines, f"{tab}}}"]


def _is_end_site(skeleton: Skeleton, joint: int) -> bool:
    """Whether a joint is a leaf with the name that a clip gives to an end site."""
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
