"""A skeleton's bones on the known walk as OptiTrack's Motive exports them, beside an unlabelled marker."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from samples.motion import in_sight, walk, y_up

RATE = 120.0
BONES: dict[str, str] = {
    "Hip": "hip_center", "Ab": "spine", "Neck": "shoulder_center", "Head": "head",
    **{
        f"{s}{bone}": f"{node}_{side}"
        for side, s in (("left", "L"), ("right", "R"))
        for bone, node in (
            ("UArm", "shoulder"), ("FArm", "elbow"), ("Hand", "wrist"), ("Thigh", "hip"), ("Shin", "knee"),
            ("Foot", "ankle"), ("Toe", "foot"),
        )
    },
}  # fmt: skip


def text(kind: str, places: dict[str, Array], *, rotations: bool = False, unit: str = "Millimeters") -> str:
    """The file. kind: Bone or Marker; places: name -> (T, 3) in the unit, Y up, NaN where not seen."""
    frames = len(next(iter(places.values())))
    columns: list[tuple[str, str, str, str, Array]] = []
    for name, place in places.items():
        if rotations:
            turn = np.tile([0.0, 0.0, 0.0, 1.0], (frames, 1))
            columns += [(kind, name, "Rotation", axis, turn[:, k]) for k, axis in enumerate("XYZW")]
        columns += [(kind, name, "Position", axis, place[:, k]) for k, axis in enumerate("XYZ")]
    columns += [("Marker", "Unlabeled 7", "Position", axis, np.full(frames, 5.0)) for axis in "XYZ"]
    head = (
        f"Format Version,1.23,Take Name,walk,Take Notes,,Export Frame Rate,{RATE:.6f},"
        f"Total Exported Frames,{frames},Rotation Type,Quaternion,Length Units,{unit},Coordinate Space,Global"
    )
    lines = [head, ""]
    for row, words in enumerate((",Type", ",Name", ",ID", ",", "Frame,Time (Seconds)")):
        cells = ["1A2A" if row == 2 else column[row if row < 2 else row - 1] for column in columns]
        lines.append(",".join([words, *cells]))
    for frame in range(frames):
        cells = ["" if np.isnan(column[4][frame]) else f"{column[4][frame]:.6f}" for column in columns]
        lines.append(",".join([str(frame), f"{frame / RATE:.6f}", *cells]))
    return "\n".join(lines) + "\n"


def bones(frames: int) -> dict[str, Array]:
    """Bone -> (T, 3) metres, Y up."""
    joints = y_up(in_sight(walk(frames, RATE)).joints)
    return {f"Walker:{bone}": joints[:, NODE_INDEX[node]] for bone, node in BONES.items()}


def files(frames: int = 90) -> dict[str, bytes]:
    """One file."""
    places = {name: 1000.0 * place for name, place in bones(frames).items()}
    return {"walk.csv": text("Bone", places, rotations=True).encode()}
