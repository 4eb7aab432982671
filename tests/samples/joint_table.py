"""A table of a Kinect v1's joints by name, as somebody's own program writes it, without a description."""

from __future__ import annotations

from kinemimic.pipeline.kinematics.skeleton import NODES
from samples.motion import walk, y_up

NAMES: tuple[str, ...] = tuple(node.title().replace("_", "") for node in NODES)


def files(frames: int = 90) -> dict[str, bytes]:
    """Milliseconds and metres, Y up."""
    motion = walk(frames)
    header = ["timestamp", *(f"{name}.{axis}" for name in NAMES for axis in "xyz")]
    rows = [
        [f"{1000.0 * time:.1f}", *(f"{value:.6f}" for value in points.ravel())]
        for time, points in zip(motion.times, y_up(motion.joints), strict=True)
    ]
    return {"joints.csv": ("\n".join(",".join(row) for row in [header, *rows]) + "\n").encode()}
