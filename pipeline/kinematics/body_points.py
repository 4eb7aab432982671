"""Points and distances of the body in any clip, for the quality rules.

Unlike `nodes.to_nodes` this raises no errors and derives no nodes: a rule must be able to examine a clip in
millimetres, lying on its side, or with implausible legs.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.joint_names import joints_by_name
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODES, SIDES
from kinemimic.pipeline.kinematics.vectors import unit


def nodes_of(clip: Clip) -> Array:
    """Positions (T, 20, 3) of the nodes, NaN for a node that the skeleton does not name."""
    points = np.full((len(clip.times), len(NODES), 3), np.nan)
    for node, joint in joints_by_name(clip.skeleton.names).items():
        points[:, NODE_INDEX[node]] = clip.positions[:, joint]
    return points


def place(points: Array, name: str) -> Array:
    """Position (T, 3) of a node; "hips", "shoulders", "ankles" … are the midpoints of both sides."""
    if name in NODE_INDEX:
        return points[:, NODE_INDEX[name]]
    joint = name.removesuffix("s")
    left, right = (points[:, NODE_INDEX[f"{joint}_{side}"]] for side in SIDES)
    return np.asarray(0.5 * (left + right))


def between(points: Array, start: str, end: str) -> Array:
    """Vectors (T, 3) from one point to another, named as in `place`."""
    return place(points, end) - place(points, start)


def length(points: Array, start: str, end: str) -> Array:
    """Distances (T,) between two points, named as in `place`."""
    return np.asarray(np.linalg.norm(between(points, start, end), axis=-1))


def bend(points: Array, side: str) -> Array:
    """Unsigned angle (T,) between thigh and shank, radians; 0 for a straight leg."""
    thigh = unit(between(points, f"hip_{side}", f"knee_{side}"))
    shank = unit(between(points, f"knee_{side}", f"ankle_{side}"))
    return np.asarray(np.arccos(np.clip(np.sum(thigh * shank, axis=-1), -1.0, 1.0)))


def relative_to_body(displacements: Array) -> Array:
    """Displacements (T, J, 3) minus their mean over the joints of each frame that have one."""
    there = np.isfinite(displacements)
    mean = np.where(there, displacements, 0.0).sum(axis=1) / np.maximum(there.sum(axis=1), 1)
    return np.asarray(displacements - mean[:, None])
