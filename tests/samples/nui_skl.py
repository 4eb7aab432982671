"""Kinect v1 .skl: the variant with 86 columns, as .NET prints numbers."""

from __future__ import annotations

from kinemimic.pipeline.kinematics.skeleton import NODES
from samples.motion import in_range, walk, y_up


def header(joints: tuple[str, ...]) -> str:
    """The header line of both versions of the recorder."""
    columns = [f"{joint}_{field}" for joint in joints for field in ("X", "Y", "Z", "tracked")]
    return "\t".join(["timestamp", "framenum", *columns, *(f"FloorPlane_{letter}" for letter in "ABCD")])


def files(frames: int = 90) -> dict[str, bytes]:
    """One file, all tracked, 33 ms a step."""
    points = y_up(in_range(walk(frames)))
    lines = [header(tuple(node.title().replace("_", "") for node in NODES))]
    for k, frame in enumerate(points):
        places = "\t".join(f"{x:.15g}\t{y:.15g}\t{z:.15g}\t2" for x, y, z in frame)
        lines.append(f"{18930265 + 33 * k}\t{k}\t{places}\t0.018\t0.9989\t0.0429\t0.6962")
    return {"walk.skl": "\r\n".join([*lines, ""]).encode()}
