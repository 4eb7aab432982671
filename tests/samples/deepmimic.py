"""DeepMimic JSON in the layout of the authors' files: one frame per line, ten decimals."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import to_rotvec
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.readers.mocap.deepmimic import BALLS, HINGES
from samples.motion import rigid_walk


def frames(count: int) -> Array:
    """Numbers (T, 44): the time to the next frame, the root, quaternions w first and hinges."""
    walk = rigid_walk(count, 30.0)
    rows = np.zeros((count, 44))
    rows[:, 0] = 1.0 / 30.0
    x, y, z = walk.root.T
    rows[:, 1:4] = np.stack([x, z, -y], axis=-1)
    for node, column in BALLS.items():
        a, b, c, w = walk.rotations[:, NODE_INDEX[node]].T
        rows[:, column : column + 4] = np.stack([w, a, c, -b], axis=-1)
    for node, column in HINGES.items():
        rows[:, column] = -to_rotvec(walk.rotations[:, NODE_INDEX[node]])[:, 1]
    return rows


def files(count: int = 90) -> dict[str, bytes]:
    """humanoid3d_walk.txt."""
    rows = ["[" + ",".join(f"{value:20.10f}" for value in row) + "]" for row in frames(count)]
    text = '{\n"Loop": "wrap",\n"Frames":\n[\n' + ",\n".join(rows) + "\n]\n}\n"
    return {"humanoid3d_walk.txt": text.encode()}
