"""A table of unknown format, as exported by a German laboratory's spreadsheet, and its description."""

from __future__ import annotations

from kinemimic.pipeline.kinematics.skeleton import NODES
from samples.motion import walk

# Our node for each name in the file.
NAMES: dict[str, str] = {
    "hip_center": "Becken",
    "spine": "Bauch",
    "shoulder_center": "Brust",
    "head": "Kopf",
    **{
        f"{node}_{side}": f"{german} {s}"
        for side, s in (("left", "L"), ("right", "R"))
        for node, german in (
            ("shoulder", "Schulter"),
            ("elbow", "Ellbogen"),
            ("wrist", "Handgelenk"),
            ("hand", "Hand"),
            ("hip", "Huefte"),
            ("knee", "Knie"),
            ("ankle", "Knoechel"),
            ("foot", "Fuss"),
        )
    },
}
DESCRIPTION = """\
kinemimic = 1

[table]
separator = "semicolon"
decimal = ","
header = 2
missing = ["-9999"]

[time]
column = "Zeit"
unit = "ms"

[space]
unit = "mm"
up = "Z"
forward = "-Y"

[columns]
position = ["{joint} x", "{joint} y", "{joint} z"]
state = "{joint} s"

[states]
missing = ["weg"]
inferred = ["unsicher"]
tracked = ["gut"]

[joints]
"""


def files(frames: int = 90) -> dict[str, bytes]:
    """Millimetres, Z up, walking along -Y, a decimal comma; the left hand is lost in every tenth frame."""
    shown = walk(frames)
    # Our X is the file's -Y, our Y its X.
    points = 1000.0 * shown.joints[..., [1, 0, 2]] * [1.0, -1.0, 1.0]
    lines = [
        "Aufnahme 7;Labor Sued",
        ";".join(["Zeit", *(f"{NAMES[node]} {part}" for node in NODES for part in "xyzs")]),
    ]
    for frame, (time, joints) in enumerate(zip(shown.times, points, strict=True)):
        cells = [f"{1000.0 * time:.2f}"]
        for node, (x, y, z) in zip(NODES, joints, strict=True):
            if node == "hand_left" and frame % 10 == 3:
                cells += ["-9999"] * 3 + ["weg"]
            else:
                cells += [f"{x:.3f}", f"{y:.3f}", f"{z:.3f}", "unsicher" if node == "foot_right" else "gut"]
        lines.append(";".join(cells).replace(".", ","))
    names = "".join(f'{node} = "{NAMES[node]}"\n' for node in NODES)
    return {
        "aufnahme.csv": ("\n".join(lines) + "\n").encode(),
        "aufnahme.toml": (DESCRIPTION + names).encode(),
    }
