"""Write poses as arrays (.npz), for numpy and machine learning."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from kinemimic.pipeline.files.store import atomic
from kinemimic.pipeline.writers.poses import Poses


def write_npz(path: Path, poses: Poses) -> None:
    """Write T poses of a root and J - 1 joints; the same poses give the same bytes, nothing is pickled.

    frame_rate: Hz; root_name; root_position (T, 3) metres in the world (Z up, X forward, Y left);
    root_rotation (T, 4); joint_names, joint_parents (J - 1,) by name; joint_rotations (T, J - 1, 4) child to
    parent; joint_offsets (T, J - 1, 3) metres, each joint's position in its parent's frame, constant if bones
    are rigid. Quaternions are (x, y, z, w).
    """
    names = poses.skeleton.names
    arrays = {
        "frame_rate": np.array(poses.rate),
        "root_name": np.array(names[0]),
        "root_position": poses.translations[:, 0],
        "root_rotation": poses.rotations[:, 0],
        "joint_names": np.array(names[1:]),
        "joint_parents": np.array([names[parent] for parent in poses.skeleton.parents[1:]]),
        "joint_offsets": poses.translations[:, 1:],
        "joint_rotations": poses.rotations[:, 1:],
    }
    with atomic(path) as temporary, temporary.open("wb") as stream:
        np.savez_compressed(stream, **arrays)  # type: ignore[arg-type]
