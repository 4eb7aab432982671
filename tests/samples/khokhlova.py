"""Khokhlova's rows: index, ms, 25 x (state, position, x y z w); zeros first, every pose polled twice."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import from_two_axes
from kinemimic.pipeline.readers.kinect.kinect_v2 import SDK_JOINTS, SDK_PARENTS
from samples.kimore import SENSOR
from samples.motion import in_sight, kinect_v2_joints, walk, y_up

EMPTY_LINES = 4
LEAVES = ("Head", "FootLeft", "FootRight", "HandTipLeft", "ThumbLeft", "HandTipRight", "ThumbRight")


def orientations(places: Array) -> Array:
    """(T, 25, 4) as the SDK defines them: +Y along the bone that ends at the joint, none at the leaves.

    places: (T, 25, 3) in the camera's axes. The root's +Y runs up the trunk.
    """
    turns = np.zeros((*places.shape[:2], 4))
    at = {name: places[:, joint] for joint, name in enumerate(SDK_JOINTS)}
    lateral = at["HipLeft"] - at["HipRight"] + np.array([0.0, 0.1, 0.02])
    for joint, (name, parent) in enumerate(zip(SDK_JOINTS, SDK_PARENTS, strict=True)):
        if name not in LEAVES:
            bone = at[name] - at[parent] if parent else at["SpineMid"] - at["SpineBase"]
            turns[:, joint] = from_two_axes(bone, lateral, "YX")
    return turns


def files(frames: int = 90) -> dict[str, bytes]:
    """A take of which each pose stands in two lines, 16 ms apart."""
    shown = in_sight(walk(frames))
    places = y_up(kinect_v2_joints(shown)) + SENSOR
    values = np.concatenate([np.full((frames, 25, 1), 2.0), places, orientations(places)], axis=-1)
    lines = [f"{k} {9 + 16 * k} {'0 ' * 175}" for k in range(EMPTY_LINES)]
    for number, (time, row) in enumerate(zip(shown.times, values.reshape(frames, -1), strict=True)):
        pose = " ".join(f"{value:.6g}" for value in row)
        for poll in (0, 1):
            index = EMPTY_LINES + 2 * number + poll
            lines.append(f"{index} {100 + round(1000 * time) + 16 * poll} {pose} ")
    return {"JointsInfo.txt": ("\n".join(lines) + "\n").encode()}
