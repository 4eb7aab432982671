"""The known motion: a real person's walk that ships with pybullet, as positions and as rotations."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from peers.straight_walk import straight_walk

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip, forward_kinematics
from kinemimic.pipeline.kinematics.orientation.from_positions import node_rotations
from kinemimic.pipeline.kinematics.rotations import Y_UP_TO_Z_UP, conjugate, multiply
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODES, Skeleton, node_skeleton
from kinemimic.pipeline.readers.mocap.deepmimic import read_deepmimic, stock_motion
from kinemimic.pipeline.virtual_kinect.subject import close_loop


@dataclass(frozen=True)
class Walk:
    """times: (T,) seconds; joints: (T, 20, 3) metres of the nodes, Z up, along +X; angles: radians."""

    times: Array
    joints: Array
    angles: dict[str, Array]


@cache
def _gait(name: str):  # type: ignore[no-untyped-def]
    return close_loop(read_deepmimic(stock_motion(name)))


def walk(frames: int = 90, rate: float = 30.0, *, motion: str = "walk") -> Walk:
    """`frames` frames of the walk (or "run")."""
    times = np.arange(frames) / rate
    shown = straight_walk(_gait(motion), times, start=np.array([0.4, 0.2]), heading=0.0, phase=0.1)
    return Walk(times, shown.joints, shown.angles)


def in_sight(shown: Walk) -> Walk:
    """The walk on a treadmill: a long take, too, stays before a sensor."""
    speed = np.ptp(shown.joints[:, 0, :2], axis=0) / max(np.ptp(shown.times), 1e-9)
    back = np.zeros((len(shown.times), 1, 3))
    back[:, 0, :2] = shown.times[:, None] * speed
    return Walk(shown.times, shown.joints - back, shown.angles)


def y_up(points: Array) -> Array:
    """Our axes (X forward, Y left, Z up) to a Y-up file's: X left, Y up, Z forward."""
    return points[..., [1, 2, 0]]


def kinect_v2_joints(walk: Walk) -> Array:
    """(T, 25, 3) in our axes, in the SDK's order, from the 20 nodes: neck, tips and thumbs are added."""
    p = {name: walk.joints[:, NODE_INDEX[name]] for name in NODES}
    neck = 0.6 * p["shoulder_center"] + 0.4 * p["head"]
    order = ["hip_center", "spine", neck, "head"]
    for side in ("left", "right"):
        order += [f"{joint}_{side}" for joint in ("shoulder", "elbow", "wrist", "hand")]
    for side in ("left", "right"):
        order += [f"{joint}_{side}" for joint in ("hip", "knee", "ankle", "foot")]
    order.append("shoulder_center")
    for side in ("left", "right"):
        wrist, hand = p[f"wrist_{side}"], p[f"hand_{side}"]
        order += [hand + 0.9 * (hand - wrist), hand + np.array([0.05, 0.0, 0.0])]
    return np.stack([p[joint] if isinstance(joint, str) else joint for joint in order], axis=1)


def seen_clip(joints: Array, times: Array | None = None, *, lost: slice = slice(0)) -> Clip:
    """Joints (T, 20, 3) as a sensor sees them, in one pass, with the rotations that they show.

    times: (T,) seconds, by default those of 30 Hz; lost: frames without the left hand.
    """
    places = joints.copy()
    places[lost, NODE_INDEX["hand_left"]] = np.nan
    return Clip(
        skeleton=node_skeleton(),
        times=np.arange(len(places)) / 30.0 if times is None else times,
        positions=places,
        states=np.full(places.shape[:2], 2, dtype=np.uint8),
        passes=np.zeros(len(places), dtype=np.int32),
        rotations=node_rotations(places),
    )


@dataclass(frozen=True)
class RigidWalk:
    """The same walk as what it is made of: rotations on a rigid skeleton of the 20 nodes.

    times: (T,) seconds; root: (T, 3) and joints: (T, 20, 3) metres, Z up; rotations: (T, 20, 4).
    """

    times: Array
    skeleton: Skeleton
    root: Array
    rotations: Array
    joints: Array


def rigid_walk(frames: int = 90, rate: float = 120.0, *, motion: str = "walk") -> RigidWalk:
    """`frames` frames of the walk along +X, as rotations."""
    gait = _gait(motion)
    times = np.arange(frames) / rate
    root, rotations = gait.pose(0.1 + times / gait.period)
    translations = np.broadcast_to(gait.skeleton.offsets, (frames, len(NODES), 3)).copy()
    translations[:, 0] = root
    return RigidWalk(
        times,
        gait.skeleton,
        root,
        rotations,
        forward_kinematics(gait.skeleton, translations, rotations)[0],
    )


def y_up_turns(rotations: Array) -> Array:
    """Quaternions (..., 4) in our axes as those of a Y-up file."""
    return multiply(multiply(conjugate(Y_UP_TO_Z_UP), rotations), Y_UP_TO_Z_UP)


def in_range(walk: Walk, near: float = 1.5, depth: float = 3.0) -> Array:
    """(T, 20, 3) joints that stay in a sensor's range, however long: the walker comes back to the start."""
    joints = walk.joints.copy()
    joints[..., 0] += near - depth * np.floor(joints[:, :1, 0] / depth)
    return joints
