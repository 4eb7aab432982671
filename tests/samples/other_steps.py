"""A real person's gait with other steps: shorter or longer, quicker or slower, or down a slope."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import SIDES
from samples.motion import walk
from samples.walker import clip_of_nodes, hips

STRETCHED = 0.999  # of the leg: as far as an ankle goes from its hip


def stepping(
    motion: str, *, length: float = 1.0, cadence: float = 1.0, slope: float = 0.0, seconds: float = 6.0
) -> Clip:
    """The stock gait ("walk" or "run") at 60 Hz along +X, with steps `length` times as long, `cadence` times
    as quick; slope: metres by which the ground rises per metre ahead.

    Ankles keep their heights above the ground, so that a run has its flight at any length. The hips move as
    before, lower by as much as the legs need to reach the ground.
    """
    times = np.arange(round(60.0 * seconds)) / 60.0
    joints = walk(len(times), 60.0 / cadence, motion=motion).joints
    middle = hips(joints)
    ahead = length * (middle[..., 0] - middle[0, 0, 0])
    moved = np.stack([ahead, middle[..., 1], middle[..., 2] + slope * ahead], axis=-1)
    positions = joints - middle + moved
    targets, lengths, lower = {}, {}, 0.0
    for side in SIDES:
        hip, knee, ankle = (N[f"{joint}_{side}"] for joint in ("hip", "knee", "ankle"))
        reach = length * (joints[:, ankle, 0] - middle[:, 0, 0])
        to = positions[:, ankle].copy()
        to[:, 0] = moved[:, 0, 0] + reach
        to[:, 2] += slope * reach
        bones = [np.linalg.norm(joints[:, b] - joints[:, a], axis=1) for a, b in ((hip, knee), (knee, ankle))]
        way = to - positions[:, hip]
        down = np.sqrt((STRETCHED * sum(bones)) ** 2 - (way[:, :2] ** 2).sum(axis=1))
        lower = max(lower, float((-way[:, 2] - down).max()))
        targets[side], lengths[side] = to, bones
    positions[..., 2] -= lower
    for side in SIDES:
        hip, knee, ankle, foot = (N[f"{joint}_{side}"] for joint in ("hip", "knee", "ankle", "foot"))
        positions[:, foot] = targets[side] + joints[:, foot] - joints[:, ankle]
        positions[:, ankle] = targets[side]
        positions[:, knee] = _knee(positions[:, hip], targets[side], *lengths[side])
    return clip_of_nodes(times, positions)


def _knee(hip: Array, ankle: Array, thigh: Array, shank: Array) -> Array:
    """The knee (T, 3), bent forward, between hip and ankle (T, 3), from the bones' lengths (T,)."""
    far = np.linalg.norm(ankle - hip, axis=1)
    line = (ankle - hip) / far[:, None]
    along = (thigh**2 - shank**2 + far**2) / (2.0 * far)
    front = [1.0, 0.0, 0.0] - line[:, :1] * line
    front /= np.linalg.norm(front, axis=1, keepdims=True)
    return np.asarray(hip + along[:, None] * line + np.sqrt(thigh**2 - along**2)[:, None] * front)
