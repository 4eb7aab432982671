"""`Name;x;y;z` lines: right before left, a Spanish hip name, no clock."""

from __future__ import annotations

from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from samples.motion import in_range, walk, y_up


def _sides(*joints: str) -> list[tuple[str, str]]:
    return [(f"{joint}-{side}", f"{joint}_{side}".lower()) for joint in joints for side in ("Right", "Left")]


# Name in the file, node.
ORDER: tuple[tuple[str, str], ...] = (
    ("Head", "head"),
    ("Shoulder-Center", "shoulder_center"),
    *_sides("Shoulder", "Elbow", "Wrist", "Hand"),
    ("Spine", "spine"),
    ("Hip-centro", "hip_center"),
    *_sides("Hip", "Knee", "Ankle", "Foot"),
)


def files(frames: int = 90) -> dict[str, bytes]:
    """One file, lines ended as on Windows, seven digits."""
    points = y_up(in_range(walk(frames)))
    text = "".join(
        f"{name};{x:.7g};{y:.7g};{z:.7g}\r\n"
        for frame in points
        for name, (x, y, z) in ((name, frame[NODE_INDEX[node]]) for name, node in ORDER)
    )
    return {"Person001_1.txt": text.encode()}
