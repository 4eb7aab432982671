"""The known walk as Vicon Nexus exports it: outputs of Plug-in-Gait's segments, then trajectories, in mm."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.angles import leg_angles
from kinemimic.pipeline.kinematics.clip import forward_kinematics
from kinemimic.pipeline.kinematics.rotations import to_rotvec
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.readers.public_datasets.uiprmd_vicon import MARKERS
from samples.motion import RigidWalk, Walk, rigid_walk
from samples.uiprmd_vicon import plug_in_gait

RATE = 120.0
FIRST_FRAME = 695
# Segment, the node at its origin, the node whose frame it has, and the node at its other end.
SEGMENTS: tuple[tuple[str, str, str, str], ...] = (
    ("PEL", "hip_center", "hip_center", "spine"),
    ("TRX", "shoulder_center", "spine", "spine"),
    ("HED", "head", "shoulder_center", "shoulder_center"),
    *(
        (f"{s}{name}", f"{origin}_{side}", f"{frame}_{side}" if frame != "spine" else frame, f"{end}_{side}")
        for side, s in (("left", "L"), ("right", "R"))
        for name, origin, frame, end in (
            ("CL", "shoulder", "spine", "shoulder"), ("HU", "elbow", "shoulder", "shoulder"),
            ("RA", "wrist", "elbow", "elbow"), ("HN", "hand", "wrist", "wrist"), ("FE", "knee", "hip", "hip"),
            ("TI", "ankle", "knee", "knee"), ("FO", "foot", "ankle", "ankle"),
        )
    ),
)  # fmt: skip


def section(title: str, names: list[str], components: list[str], units: list[str], rows: Array) -> list[str]:
    """The lines of a section; names: "" above all but the first of a name's columns; NaN: empty cells."""
    width = len(components) + 2
    cells = [
        [str(FIRST_FRAME + k), "0", *("" if np.isnan(value) else f"{value:.6g}" for value in row)]
        for k, row in enumerate(rows)
    ]
    head = [[title], [f"{RATE:g}"], ["", "", *names], ["Frame", "Sub Frame", *components], ["", "", *units]]
    return [",".join(row + [""] * (width - len(row))) for row in [*head, *cells]]


def outputs(shown: RigidWalk, subject: str = "Test") -> list[str]:
    """Segments, and the angles of knees and hips."""
    world = forward_kinematics(shown.skeleton, np.zeros((*shown.rotations.shape[:2], 3)), shown.rotations)[1]
    names, components, units, columns = [], [], [], []
    for name, origin, frame, end in SEGMENTS:
        place, turn = shown.joints[:, NODE_INDEX[origin]], world[:, NODE_INDEX[frame]]
        length = np.linalg.norm(place - shown.joints[:, NODE_INDEX[end]], axis=-1)
        names += [f"{subject}:{name}", *[""] * 8]
        components += ["RX", "RY", "RZ", "TX", "TY", "TZ", "SX", "SY", "SZ"]
        units += ["deg"] * 3 + ["mm"] * 6
        columns += [
            np.degrees(to_rotvec(turn)),
            1000.0 * place,
            1000.0 * np.repeat(length[:, None], 3, axis=1),
        ]
    for angle, curve in leg_angles(shown.joints).items():
        joint, side = angle.split("_")
        names += [f"{subject}:{side[0].upper()}{joint.title()}Angles", "", ""]
        components += ["X", "Y", "Z"]
        units += ["deg"] * 3
        columns.append(np.stack([np.degrees(curve), 0.0 * curve, 0.0 * curve], axis=-1))
    return section("Model Outputs", names, components, units, np.hstack(columns))


def trajectories(shown: RigidWalk, subject: str = "Test") -> list[str]:
    """Markers of Plug-in-Gait; one is not seen in the third frame."""
    places = plug_in_gait(Walk(shown.times, shown.joints, {}))
    points = 1000.0 * np.stack([places[label] for label in MARKERS], axis=1)
    points[2, MARKERS.index("LFIN")] = np.nan
    names = [cell for label in MARKERS for cell in (f"{subject}:{label}", "", "")]
    width = 3 * len(MARKERS)
    return section(
        "Trajectories", names, ["X", "Y", "Z"] * len(MARKERS), ["mm"] * width, points.reshape(-1, width)
    )


def files(frames: int = 90) -> dict[str, bytes]:
    """Both sections in one file, a blank line between them."""
    shown = rigid_walk(frames, RATE)
    lines = [*outputs(shown), "", *trajectories(shown)]
    return {"walk.csv": ("\n".join(lines) + "\n").encode()}
