"""Write DeepMimic motions: JSON with 44 numbers per frame, for the humanoid that ships with Bullet."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.files.store import write_text
from kinemimic.pipeline.kinematics.rotations import to_rotvec
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODES, SIDES
from kinemimic.pipeline.readers.mocap.deepmimic import BALLS, COLUMNS, HINGES, ROOT, offsets
from kinemimic.pipeline.writers.poses import Poses


def write_deepmimic(path: Path, poses: Poses, *, loop: bool) -> None:
    """Write poses of the 20 nodes in the layout of the files published by DeepMimic's authors.

    loop: the motion repeats, and its last frame is its first one a cycle later, as the format requires. The
    humanoid has fixed lengths: the root, there the midpoint of the hips, is scaled by the ratio of leg
    lengths, so that feet stay on the ground and do not slide. It has no wrists; knees and elbows rotate only
    about their lateral axis.
    """
    if poses.skeleton.names != NODES:
        raise ValueError("a DeepMimic motion needs poses of the 20 nodes")
    rows = [
        "[" + ",".join(f"{value:20.10f}" for value in row) + "]" for row in deepmimic_frames(poses).tolist()
    ]
    wrap_mode = json.dumps("wrap" if loop else "none")
    write_text(path, f'{{\n"Loop": {wrap_mode},\n"Frames":\n[\n' + ",\n".join(rows) + "\n]\n}\n")


def deepmimic_frames(poses: Poses) -> Array:
    """Frames (T, 44): seconds to the next frame, root, quaternions w first, hinges in radians."""
    positions, _ = poses.kinematics()
    hips = np.mean([positions[:, NODE_INDEX[f"hip_{side}"]] for side in SIDES], axis=0)
    x, y, z = (_legs(offsets()) / _legs(poses.skeleton.offsets) * hips).T
    rows = np.zeros((len(poses.rotations), COLUMNS))
    rows[:-1, 0] = 1.0 / poses.rate  # zero in the last frame, as in the published files
    rows[:, ROOT] = np.stack([x, z, -y], axis=-1)
    for node, column in BALLS.items():
        a, b, c, w = poses.rotations[:, NODE_INDEX[node]].T
        rows[:, column : column + 4] = np.stack([w, a, c, -b], axis=-1)
    for node, column in HINGES.items():
        rows[:, column] = -to_rotvec(poses.rotations[:, NODE_INDEX[node]])[:, 1]
    return rows + 0.0  # no -0.0


def _legs(offsets_of_nodes: Array) -> float:
    """Length of thigh plus shank, summed over both sides, in metres, from offsets (20, 3)."""
    bones = [NODE_INDEX[f"{joint}_{side}"] for joint in ("knee", "ankle") for side in SIDES]
    return float(np.linalg.norm(offsets_of_nodes[bones], axis=-1).sum())
