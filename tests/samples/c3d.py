"""C3D: a laboratory's markers on the known walk, written by ezc3d."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import ezc3d
import numpy as np

from kinemimic.pipeline.arrays import Array
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
