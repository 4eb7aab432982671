"""CAD-60's layout: a frame number, orientations, positions in mm and confidences; END in the last line."""

from __future__ import annotations

from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from samples.motion import in_range, walk, y_up

ORIENTED = (
    *("head", "shoulder_center", "spine", "shoulder_left", "elbow_left", "shoulder_right", "elbow_right"),
    *("hip_left", "knee_left", "hip_right", "knee_right"),
)
ORDER = (*ORIENTED, "wrist_left", "wrist_right", "ankle_left", "ankle_right")
UNSURE = "wrist_right"
_ORIENTATION = "0.8,-0.6,0,0.6,0.8,0,0,0,1,1,"


def files(frames: int = 90) -> dict[str, bytes]:
    """The walk, one wrist of which the tracker is not sure."""
    lines = []
    for number, body in enumerate(y_up(in_range(walk(frames))), 1):
        line = f"{number},"
        for joint in ORDER:
            x, y, z = 1000.0 * body[NODE_INDEX[joint]]
            line += (
                _ORIENTATION if joint in ORIENTED else ""
            ) + f"{x:.1f},{y:.1f},{z:.1f},{int(joint != UNSURE)},"
        lines.append(line)
    return {"0512000000.txt": "\n".join([*lines, "END", ""]).encode()}
