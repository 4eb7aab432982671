"""Small tables with a description in the same folder, read like any user's."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from samples.motion import walk

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODES
from kinemimic.pipeline.readers import recognise

FRAMES = 40
NODE_LIST = "joints = [" + ", ".join(f'"{node}"' for node in NODES) + "]\n"


def table(rows: Array, separator: str = ",", decimals: int = 6) -> str:
    return "".join(separator.join(f"{v:.{decimals}f}" for v in row) + "\n" for row in rows)


def read(folder: Path, capture: str, description: str) -> Clip:
    (folder / "walk.csv").write_text(capture)
    (folder / "walk.toml").write_text(description)
    return recognise.read(folder / "walk.csv")


def joints() -> Array:
    return walk(FRAMES).joints


# Right, up, forward as Unity has them: a left-handed system. Our left is its -X.
UNITY = 'up = "Y"\nforward = "Z"\nleft = "-X"\n'


def unity(points: Array) -> Array:
    return np.stack([-points[..., 1], points[..., 2], points[..., 0]], axis=-1)
