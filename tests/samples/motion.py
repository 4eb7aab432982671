"""The known motion: a real person's walk that ships with pybullet, as positions and as rotations."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.captures.deepmimic import read_deepmimic, stock_motion
from kinemimic.pipeline.captures.subject import close_loop, perform
from kinemimic.pipeline.skeleton import NODE_INDEX, NODES

Array = NDArray[np.float64]


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
    shown = perform(_gait(motion), times, start=np.array([0.4, 0.2]), heading=0.0, phase=0.1)
    return Walk(times, shown.joints, shown.angles)


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
