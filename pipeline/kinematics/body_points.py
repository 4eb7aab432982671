"""The body in a clip, as the rules look at it: the nodes that the skeleton names, whatever their lengths.

Unlike `nodes.to_nodes` this raises nothing and invents nothing: a rule must be able to look at a clip in
millimetres, on its side or with legs that no human has.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.nodes import joints_of_nodes
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODES


def nodes_of(clip: Clip) -> Array:
    """Positions (T, 20, 3) of the nodes, NaN for a node that the skeleton does not name."""
    points = np.full((len(clip.times), len(NODES), 3), np.nan)
    for node, joint in joints_of_nodes(clip.skeleton.names).items():
        points[:, NODE_INDEX[node]] = clip.positions[:, joint]
    return points


def place(points: Array, name: str) -> Array:
    """Where a node is, (T, 3); "hips", "shoulders", "ankles" … are the middles of both sides."""
    if name in NODE_INDEX:
        return points[:, NODE_INDEX[name]]
    joint = name.removesuffix("s")
    left, right = (points[:, NODE_INDEX[f"{joint}_{side}"]] for side in ("left", "right"))
    return np.asarray(0.5 * (left + right))


def between(points: Array, start: str, end: str) -> Array:
    """Vectors (T, 3) from a node, or a middle, to another; see `place`."""
    return place(points, end) - place(points, start)


def length(points: Array, start: str, end: str) -> Array:
    """Distances (T,) of two nodes."""
    return np.asarray(np.linalg.norm(between(points, start, end), axis=-1))


def bend(points: Array, side: str) -> Array:
    """Angle (T,) between thigh and shank, radians, 0 for a straight leg, whichever way it bends."""
    thigh = unit(between(points, f"hip_{side}", f"knee_{side}"))
    shank = unit(between(points, f"knee_{side}", f"ankle_{side}"))
    return np.asarray(np.arccos(np.clip(np.sum(thigh * shank, axis=-1), -1.0, 1.0)))


def unit(vectors: Array) -> Array:
    """Vectors (..., 3) of length one; NaN for those without length."""
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(lengths > 0, lengths, np.nan))


def median(values: Array) -> float:
    """The median of the values that are there; NaN if none is."""
    there = values[np.isfinite(values)]
    return float(np.median(there)) if len(there) else float("nan")


def beside_the_body(ways: Array) -> Array:
    """Ways (T, J, 3) less the mean way of the joints of that frame which have one."""
    there = np.isfinite(ways)
    mean = np.where(there, ways, 0.0).sum(axis=1) / np.maximum(there.sum(axis=1), 1)
    return np.asarray(ways - mean[:, None])
