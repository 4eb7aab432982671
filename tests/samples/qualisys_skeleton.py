"""A skeleton on the known walk as Qualisys Track Manager exports it, in mm."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from samples.motion import walk

RATE = 85.0
# Segment -> the node at its position.
SEGMENTS = {
    "Hips": "hip_center", "Spine": "spine", "Neck": "shoulder_center", "Head": "head",
    **{
        f"{side}{bone}": f"{node}_{side.lower()}"
        for side in ("Left", "Right")
        for bone, node in (
            ("Arm", "shoulder"), ("ForeArm", "elbow"), ("Hand", "wrist"),
            ("UpLeg", "hip"), ("Leg", "knee"), ("Foot", "ankle"), ("ToeBase", "foot"),
        )
    },
}  # fmt: skip


def places(frames: int) -> Array:
    """(T, S, 3) metres of SEGMENTS."""
    return walk(frames, RATE).joints[:, [NODE_INDEX[node] for node in SEGMENTS.values()]]


def text(points: Array, *, reference: str = "GLOBAL", empty: str = "") -> str:
    """The file; points: (T, S, 3) mm, NaN where not solved; empty: the cell below a segment's name."""
    names = "\t".join("\t".join((name, "X", "Y", "Z", "QX", "QY", "QZ", "QW")) for name in SEGMENTS)
    lines = [
        f"NO_OF_FRAMES\t{len(points)}",
        "NO_OF_CAMERAS\t8",
        f"FREQUENCY\t{RATE:g}",
        "TIME_STAMP\t2026-01-19, 10:19:43.755\t2063631.96175450",
        f"REFERENCE\t{reference}",
        "SCALE\t1.00000",
        "SOLVER\tTheia Markerless",
        f"Frame\tTime\t{names}",
    ]
    for frame, row in enumerate(points):
        cells = [
            cell
            for place in row
            for cell in (empty, *("" if np.isnan(v) else f"{v:.3f}" for v in place), "0", "0", "0", "1")
        ]
        lines.append("\t".join([f"{frame + 1}", f"{frame / RATE:.5f}", *cells]))
    return "\n".join(lines) + "\n"


def files(frames: int = 90) -> dict[str, bytes]:
    """One file."""
    return {"walk_s_S1.tsv": text(1000.0 * places(frames)).encode()}
