"""Joint orientations as a Kinect SDK derives them: from the noisy joints, bone by bone, unsmoothed.

Deliberately independent of pipeline/kinematics/orientation/from_positions.py: a simulated sensor that shared
the pipeline's own construction would hide its errors.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import (
    IDENTITY,
    conjugate,
    continuous,
    from_axis_angle,
    from_two_axes,
    multiply,
    rotate,
)
from kinemimic.pipeline.kinematics.skeleton import (
    NODE_INDEX,
    NODE_PARENTS,
    NODES,
    SIDES,
    Skeleton,
    node_skeleton,
)

# Angle of a foot's bone below the horizontal at rest, radians.
FOOT_REST = np.radians(15.0)
# Sine of the bend at which a limb's own normal and the body's lateral axis have equal weight for the twist.
_BEND = 0.3
_LIMBS: tuple[tuple[str, str, str, str, float], ...] = tuple(
    (f"{start}_{side}", f"{middle}_{side}", f"{end}_{side}", f"{tip}_{side}", bend)
    for start, middle, end, tip, bend in (
        ("shoulder", "elbow", "wrist", "hand", -1.0),
        ("hip", "knee", "ankle", "foot", 1.0),
    )
    for side in SIDES
)


def joint_rotations(positions: Array) -> Array:
    """Local rotations (T, 20, 4), child to parent, from joints (T, 20, 3); identity = upright, arms hanging.

    If a joint that a rotation needs is lost (NaN), the rotation keeps its last known value.
    """
    p = {node: positions[:, NODE_INDEX[node]] for node in NODES}
    world = np.broadcast_to(IDENTITY, (*positions.shape[:2], 4)).copy()

    def set_world(node: str, frame: Array) -> None:
        world[:, NODE_INDEX[node]] = frame

    with np.errstate(invalid="ignore"):
        pelvis = _frame(p["hip_left"] - p["hip_right"], p["spine"] - p["hip_center"], "YZ")
        set_world("hip_center", pelvis)
        torso = _frame(p["shoulder_center"] - p["spine"], p["shoulder_left"] - p["shoulder_right"], "ZY")
        set_world("spine", torso)
        neck = _frame(p["head"] - p["shoulder_center"], rotate(torso, np.array([0.0, 1.0, 0.0])), "ZY")
        set_world("shoulder_center", neck)
        for start, middle, end, tip, bend in _LIMBS:
            upper, lower = p[middle] - p[start], p[end] - p[middle]
            body = rotate(torso if bend < 0 else pelvis, np.array([0.0, 1.0, 0.0]))
            normal = bend * np.cross(_unit(upper), _unit(lower))
            hinge = normal + _BEND * body
            set_world(start, _frame(-upper, hinge, "ZY"))
            set_world(middle, _frame(-lower, hinge, "ZY"))
            end_bone = p[tip] - p[end]
            if bend < 0:
                set_world(end, _frame(-end_bone, hinge, "ZY"))
            else:
                set_world(
                    end, multiply(_frame(end_bone, hinge, "XY"), from_axis_angle("Y", np.array(-FOOT_REST)))
                )
    local = np.broadcast_to(IDENTITY, world.shape).copy()
    for node, parent in enumerate(NODE_PARENTS):
        if NODES[node].split("_")[0] in ("head", "hand", "foot"):
            continue  # end nodes have no rotation
        local[:, node] = (
            world[:, node] if parent < 0 else multiply(conjugate(world[:, parent]), world[:, node])
        )
    return continuous(hold_last(local))


def calibrate(positions: Array, tracked: NDArray[np.bool_], rotations: Array) -> Skeleton:
    """The 20-node skeleton with constant offsets in metres, as a recorder would calibrate it from its data.

    positions: (T, 20, 3); tracked: (T, 20) frames to use; rotations: as from `joint_rotations`. Bones along a
    limb or the trunk get their median length; hips and shoulders their median position relative to the body.
    """
    pelvis = rotations[:, 0]
    torso = multiply(pelvis, rotations[:, NODE_INDEX["spine"]])
    foot = np.array([np.cos(FOOT_REST), 0.0, -np.sin(FOOT_REST)])
    offsets = np.zeros((len(NODES), 3))
    for node, parent in enumerate(NODE_PARENTS[1:], start=1):
        reliable = (
            tracked[:, node] & tracked[:, parent] & np.isfinite(positions[:, [node, parent]]).all(axis=(1, 2))
        )
        bone = positions[reliable, node] - positions[reliable, parent]
        kind = NODES[node].split("_")[0]
        if NODES[node] in ("hip_left", "hip_right", "shoulder_left", "shoulder_right"):
            body = pelvis if kind == "hip" else torso
            offsets[node] = np.median(rotate(conjugate(body[reliable]), bone), axis=0)
            continue
        length = float(np.median(np.linalg.norm(bone, axis=-1)))
        points_up = NODES[node] in ("spine", "shoulder_center", "head")
        offsets[node] = length * (
            foot if kind == "foot" else np.array([0.0, 0.0, 1.0 if points_up else -1.0])
        )
    return node_skeleton(offsets)


def hold_last(values: Array) -> Array:
    """Values (T, J, n) with NaN replaced by the joint's last known value, or by its first one at the
    start."""
    known = np.isfinite(values).all(axis=-1)
    frames = np.arange(len(values))[:, None]
    end_bone = np.maximum.accumulate(np.where(known, frames, -1), axis=0)
    end_bone = np.where(end_bone < 0, np.argmax(known, axis=0), end_bone)
    return values[end_bone, np.arange(values.shape[1])]


def _unit(v: Array) -> Array:
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))


def _frame(primary: Array, secondary: Array, names: str) -> Array:
    """`from_two_axes` where both directions are known, else NaN."""
    frame = np.full((len(primary), 4), np.nan)
    known = np.isfinite(primary).all(axis=-1) & np.isfinite(secondary).all(axis=-1)
    if known.any():
        frame[known] = from_two_axes(primary[known], secondary[known], names)
    return frame
