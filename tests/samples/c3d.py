"""C3D: a laboratory's markers on the known walk, written by ezc3d."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path
from typing import Any

import ezc3d
import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, SIDES
from kinemimic.pipeline.readers.kinect.treadmill import NODE_OF_LABEL
from samples.motion import in_sight, walk, y_up
from samples.trc import RATE, markers


def written(
    labels: list[str], points: Array, *, rate: float, units: str = "", **parameters: list[Any]
) -> bytes:
    """points: (T, N, 3) in `units`, NaN where not seen; parameters: more of POINT."""
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [rate]
    file["parameters"]["POINT"]["LABELS"]["value"] = labels
    file["parameters"]["POINT"]["UNITS"]["value"] = [units] if units else []
    for name, value in parameters.items():
        file.add_parameter("POINT", name, value)
    data = np.ones((4, len(labels), len(points)))
    data[:3] = points.transpose(2, 1, 0)
    file["data"]["points"] = data
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "walk.c3d"
        file.write(str(path))
        return path.read_bytes()


def files(frames: int = 90) -> dict[str, bytes]:
    """Markers in mm, Z up."""
    places = markers(in_sight(walk(frames, RATE)))
    points = 1000.0 * np.stack(list(places.values()), axis=1)
    return {"walk.c3d": written(list(places), points, rate=RATE, units="mm", Y_SCREEN=["+Z"])}


def kinect(frames: int = 90) -> bytes:
    """The 20 joints as the treadmill's recorder names them, metres, Y up, with the left knee's angle."""
    shown = in_sight(walk(frames, 30.0))
    angle = 180.0 - np.degrees(shown.angles["knee_left"])
    points = np.concatenate([y_up(shown.joints), np.repeat(angle, 3).reshape(-1, 1, 3)], axis=1)
    return written([*NODE_OF_LABEL, "Left Knee Angle"], points, rate=50.0, units="m")


def segments(frames: int = 30) -> bytes:
    """The joints of the walk as the origins of Theia3D's segments, metres, Z up, without any point."""
    shown = in_sight(walk(frames, RATE))
    names = {"pelvis": "hip_center", "torso": "spine", "head": "head"} | {
        f"{side[0]}_{segment}": f"{joint}_{side}"
        for side in SIDES
        for segment, joint in (
            ("uarm", "shoulder"), ("larm", "elbow"), ("hand", "wrist"), ("thigh", "hip"), ("shank", "knee"),
            ("foot", "ankle"), ("toes", "foot"),
        )
    }  # fmt: skip
    matrices = np.zeros((4, 4, len(names), frames))
    matrices[range(4), range(4)] = 1.0
    matrices[:3, 3] = shown.joints[:, [NODE_INDEX[node] for node in names.values()]].transpose(2, 1, 0)
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [RATE]
    file["parameters"]["POINT"]["UNITS"]["value"] = ["m"]
    file["data"]["points"] = np.zeros((4, 0, frames))
    file["data"]["rotations"] = matrices
    labels = [f"{name}_4X4" for name in names]
    for name, value in (("LABELS", labels), ("RATE", [RATE]), ("USED", [len(labels)]), ("RATIO", [1])):
        file.add_parameter("ROTATION", name, value)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "walk.c3d"
        file.write(str(path))
        return path.read_bytes()


def big_endian(content: bytes) -> bytes:
    """A file that ezc3d wrote, of floats, as a big-endian computer has it."""
    swapped = bytearray(content)

    def swap(start: int, end: int, size: int) -> None:
        for at in range(start, end - size + 1, size):
            swapped[at : at + size] = content[at : at + size][::-1]

    swap(2, 12, 2)
    swap(12, 16, 4)
    swap(16, 20, 2)
    swap(20, 24, 4)
    at = (content[0] - 1) * 512
    swapped[at + 3] = 86
    at += 4
    while content[at]:
        group = content[at + 1]
        at += 2 + min(content[at], 256 - content[at])  # negative in a locked group
        swap(at, at + 2, 2)
        if group < 128:  # a parameter, not a group
            dimensions = content[at + 4 : at + 4 + content[at + 3]]
            data = at + 4 + len(dimensions)
            size = {2: 2, 4: 4}.get(content[at + 2], 1)
            swap(data, data + size * math.prod(dimensions), size)
        at += int.from_bytes(content[at : at + 2], "little")
    swap((int.from_bytes(content[16:18], "little") - 1) * 512, len(content), 4)
    return bytes(swapped)
