"""The treadmill recorder's ASCII: eight header lines, 20 joints, its own internal angles, a wrong rate."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import NODES
from samples.motion import in_range, walk, y_up

DECLARED = 50
# Label, and the three nodes whose angle at the middle one it is.
CORNERS: dict[str, tuple[str, str, str]] = {
    f"{side} {label} Angle": (a, f"{b}_{side.lower()}", f"{c}_{side.lower()}")
    for label, first, b, c in (
        ("Knee", "hip", "knee", "ankle"),
        ("Foot", "knee", "ankle", "foot"),
        ("Elbow", "shoulder", "elbow", "wrist"),
        ("Shoulder", "", "shoulder", "elbow"),
    )
    for side in ("Left", "Right")
    for a in [f"{first}_{side.lower()}" if first else "shoulder_center"]
}


def label(node: str) -> str:
    """Left Shoulder of shoulder_left, Hip Center of hip_center."""
    joint, _, side = node.partition("_")
    return " ".join(w.title() for w in ((side, joint) if side in ("left", "right") else (joint, side)) if w)


def files(frames: int = 90, rate: float = 30.0) -> dict[str, bytes]:
    """One file of a walk at a true rate; its last frame is all zero, as in the recordings."""
    points = y_up(in_range(walk(frames, rate)))
    angles = []
    for a, b, c in CORNERS.values():
        u, v = points[:, N[a]] - points[:, N[b]], points[:, N[c]] - points[:, N[b]]
        cosine = (u * v).sum(axis=1) / np.linalg.norm(u, axis=1) / np.linalg.norm(v, axis=1)
        angles.append(np.degrees(np.arccos(np.clip(cosine, -1, 1))))
    table = np.column_stack([points.reshape(frames, -1), np.repeat(np.stack(angles, axis=1), 3, axis=1)])
    table[-1] = 0.0
    names = [label(node) for node in NODES] + list(CORNERS)
    head = [
        f"Frame number\t{frames}",
        "First frame\t1",
        f"Point frequency\t{DECLARED}",
        f"Analog frequency\t{DECLARED}",
        "",
        "Time\t" + "\t".join(f"{name}\t\t" for name in names),
        "s" + "\tm" * 60 + "\tdegrees" * 24,
        "\tX\tY\tZ" * len(names),
    ]
    rows = [f"{k / DECLARED:g}\t" + "\t".join(f"{x:.6g}" for x in row) for k, row in enumerate(table)]
    return {"skeleton_3d.txt": "\n".join([*head, *rows, ""]).encode("latin-1")}
