"""Joint orientations as a Kinect SDK derives them: from the noisy joints, bone by bone, nothing smoothed.

This is the sensor's side, kept apart from pipeline/orient.py on purpose: a simulated sensor that shared the
pipeline's own construction would hide its errors.
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
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODE_PARENTS, NODES, Skeleton, node_skeleton

# A foot's bone at rest points this far below the horizontal, radians.
FOOT_REST = np.radians(15.0)
# Sine of the bend at which a limb's own normal and the body's lateral axis count the same for the twist.
_BEND = 0.3
_LIMBS: tuple[tuple[str, str, str, str, float], ...] = tuple(
    (f"{start}_{side}", f"{middle}_{side}", f"{end}_{side}", f"{tip}_{side}", bend)
    for start, middle, end, tip, bend in (
        ("shoulder", "elbow", "wrist", "hand", -1.0),
        ("hip", "knee", "ankle", "foot", 1.0),
    )
    for side in ("left", "right")
)


def joint_rotations(positions: Array) -> Array:
    """Local rotations (T, 20, 4), child to parent, from joints (T, 20, 3); identity = upright, arms hanging.

    Where a joint that a rotation needs is lost (NaN), the rotation keeps its last known value.
    """
    p = {node: positions[:, NODE_INDEX[node]] for node in NODES}
    world = np.broadcast_to(IDENTITY, (*positions.shape[:2], 4)).copy()

    def turn(node: str, frame: Array) -> None:
        world[:, NODE_INDEX[node]] = frame

    with np.errstate(invalid="ignore"):
        pelvis = _frame(p["hip_left"] - p["hip_right"], p["spine"] - p["hip_center"], "YZ")
        turn("hip_center", pelvis)
        torso = _frame(p["shoulder_center"] - p["spine"], p["shoulder_left"] - p["shoulder_right"], "ZY")
        turn("spine", torso)
        neck = _frame(p["head"] - p["shoulder_center"], rotate(torso, np.array([0.0, 1.0, 0.0])), "ZY")
        turn("shoulder_center", neck)
        for start, middle, end, tip, bend in _LIMBS:
            upper, lower = p[middle] - p[start], p[end] - p[middle]
            body = rotate(torso if bend < 0 else pelvis, np.array([0.0, 1.0, 0.0]))
            normal = bend * np.cross(_unit(upper), _unit(lower))
            hinge = normal + _BEND * body
            turn(start, _frame(-upper, hinge, "ZY"))
            turn(middle, _frame(-lower, hinge, "ZY"))
            last = p[tip] - p[end]
            if bend < 0:
                turn(end, _frame(-last, hinge, "ZY"))
            else:
                turn(end, multiply(_frame(last, hinge, "XY"), from_axis_angle("Y", np.array(-FOOT_REST))))
    local = np.broadcast_to(IDENTITY, world.shape).copy()
    for node, parent in enumerate(NODE_PARENTS):
        if NODES[node].split("_")[0] in ("head", "hand", "foot"):
            continue  # end nodes turn nothing
        local[:, node] = (
            world[:, node] if parent < 0 else multiply(conjugate(world[:, parent]), world[:, node])
        )
    return continuous(hold(local))


def calibrate(positions: Array, tracked: NDArray[np.bool_], rotations: Array) -> Skeleton:
    """The 20-node skeleton with constant offsets, metres, as a recorder would take them from what it saw.

    positions: (T, 20, 3); tracked: (T, 20) frames to trust; rotations: as from `joint_rotations`.
    A bone along a limb or the trunk has its median length; hips and shoulders their median place on the body.
    """
    pelvis = rotations[:, 0]
    torso = multiply(pelvis, rotations[:, NODE_INDEX["spine"]])
    foot = np.array([np.cos(FOOT_REST), 0.0, -np.sin(FOOT_REST)])
    offsets = np.zeros((len(NODES), 3))
    for node, parent in enumerate(NODE_PARENTS[1:], start=1):
        good = (
            tracked[:, node] & tracked[:, parent] & np.isfinite(positions[:, [node, parent]]).all(axis=(1, 2))
        )
        bone = positions[good, node] - positions[good, parent]
        kind = NODES[node].split("_")[0]
        if NODES[node] in ("hip_left", "hip_right", "shoulder_left", "shoulder_right"):
            body = pelvis if kind == "hip" else torso
            offsets[node] = np.median(rotate(conjugate(body[good]), bone), axis=0)
            continue
        length = float(np.median(np.linalg.norm(bone, axis=-1)))
        up = NODES[node] in ("spine", "shoulder_center", "head")
        offsets[node] = length * (foot if kind == "foot" else np.array([0.0, 0.0, 1.0 if up else -1.0]))
    return node_skeleton(offsets)


def hold(values: Array) -> Array:
    """Each joint's last known value in place of NaN, (T, J, n); before the first known one, that one."""
    known = np.isfinite(values).all(axis=-1)
    frames = np.arange(len(values))[:, None]
    last = np.maximum.accumulate(np.where(known, frames, -1), axis=0)
    last = np.where(last < 0, np.argmax(known, axis=0), last)
    return values[last, np.arange(values.shape[1])]


def _unit(v: Array) -> Array:
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))


def _frame(primary: Array, secondary: Array, names: str) -> Array:
    """`from_two_axes` where both directions are known, NaN elsewhere."""
    frame = np.full((len(primary), 4), np.nan)
    known = np.isfinite(primary).all(axis=-1) & np.isfinite(secondary).all(axis=-1)
    if known.any():
        frame[known] = from_two_axes(primary[known], secondary[known], names)
    return frame
