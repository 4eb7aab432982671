"""BVH as a suit or an optical laboratory writes it: centimetres, Z-X-Y, one root with six channels."""

from __future__ import annotations

import tempfile
from pathlib import Path

from kinemimic.pipeline.writers.bvh import write_bvh
from kinemimic.pipeline.writers.poses import Poses
from samples.motion import rigid_walk


def files(frames: int = 90) -> dict[str, bytes]:
    """walk.bvh: the 20 nodes with rotations of six decimals."""
    walk = rigid_walk(frames)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "walk.bvh"
        write_bvh(path, Poses.rigid(walk.skeleton, 120.0, walk.root, walk.rotations), order="ZXY")
        return {"walk.bvh": path.read_bytes()}
