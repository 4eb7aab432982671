"""A Processing session: header, frame count, a few features, positions and orientations (w first)."""

from __future__ import annotations

import numpy as np

from samples.khokhlova import orientations
from samples.kimore import SENSOR
from samples.motion import in_sight, kinect_v2_joints, walk, y_up

FIRST_COUNT = 94
_FEATURES = ("bodySize", "dispersion", "momentumTotal")
_FIELDS = ("PositionX", "PositionY", "PositionZ", *(f"Orientation{part}" for part in "WXYZ"))


def files(frames: int = 90) -> dict[str, bytes]:
    """A session in which the sketch was slow once: it skips a frame in the middle."""
    places = y_up(kinect_v2_joints(in_sight(walk(frames)))) + SENSOR
    turns = orientations(places)[..., [3, 0, 1, 2]]
    header = ["frameCount", *_FEATURES, *(f"joint{joint}{field}" for joint in range(25) for field in _FIELDS)]
    lines = [" ".join(header) + " "]
    for number, row in enumerate(np.concatenate([places, turns], axis=-1).reshape(frames, -1)):
        count = FIRST_COUNT + number + (number > frames // 2)
        lines.append(f"{count} 1.5 0.25 3 " + " ".join(f"{value:.8g}" for value in row) + " ")
    return {"skeleton1.txt": ("\n".join(lines) + "\n").encode()}
