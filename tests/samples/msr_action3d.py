"""MSR-Action3D lines: x y z confidence, 20 lines per frame in the data set's own order."""

from __future__ import annotations

from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from samples.motion import in_range, walk, y_up

_LIMBS = ("elbow", "wrist", "hand", "knee", "ankle", "foot")
ORDER: tuple[str, ...] = (
    *("shoulder_left", "shoulder_right", "shoulder_center", "spine", "hip_left", "hip_right", "hip_center"),
    *(f"{joint}_{side}" for joint in _LIMBS for side in ("left", "right")),
    "head",
)
UNSEEN = ("shoulder_center", "spine", "hip_center", "foot_left", "foot_right")


def files(frames: int = 90) -> dict[str, bytes]:
    """One file; what the tracker never sees has confidence 0."""
    points = y_up(in_range(walk(frames, rate=15.0)))
    text = "".join(
        " ".join(f"{x:.6f}" for x in frame[NODE_INDEX[node]]) + f" {0.0 if node in UNSEEN else 1.0:.6f}\n"
        for frame in points
        for node in ORDER
    )
    return {"a16_s01_e01_skeleton3D.txt": text.encode()}
