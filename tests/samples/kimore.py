"""KIMORE CSV: empty lines before anybody is tracked, then 25 x (x, y, z, state) with a trailing comma."""

from __future__ import annotations

import numpy as np

from samples.motion import in_sight, kinect_v2_joints, walk, y_up

EMPTY_LINES = 5
# The sensor stands before the middle of the walk, at the height of a table; metres in its axes.
SENSOR = np.array([0.3, -0.9, 2.5])


def files(frames: int = 90) -> dict[str, bytes]:
    """A raw take."""
    places = y_up(kinect_v2_joints(in_sight(walk(frames)))) + SENSOR
    rows = [",".join(f"{x:.6g},{y:.6g},{z:.6g},2" for x, y, z in frame) + "," for frame in places]
    return {"JointPosition.csv": ("\n" * EMPTY_LINES + "\n".join(rows) + "\n").encode()}


def smoothed(frames: int = 90) -> bytes:
    """The same take as a smoothed copy has it: states beside the whole numbers, a zero at the end."""
    lines = files(frames)["JointPosition.csv"].decode().split()
    rows = [line.rstrip(",").split(",") for line in lines]
    for number, row in enumerate(rows):
        row[3::4] = [f"{2 + 0.03 * np.sin(number + joint):.9f}" for joint in range(25)]
    return "\n".join(",".join([*row, "0"]) for row in rows).encode()
