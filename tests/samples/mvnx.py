"""The known walk as MVN exports it: XML, a T-pose before the movement, times in whole milliseconds."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.angles import leg_angles
from kinemimic.pipeline.kinematics.clip import forward_kinematics
from kinemimic.pipeline.kinematics.rotations import from_axis_angle, multiply
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from samples.motion import RigidWalk, rigid_walk

RATE = 60.0
# Segment, joint above it, segment above it, and the nodes at its origin and of its rotation.
TREE: tuple[tuple[str, str, str, str, str], ...] = (
    ("Pelvis", "", "", "hip_center", "hip_center"),
    ("L5", "jL5S1", "Pelvis", "hip_center", "hip_center"),
    ("L3", "jL4L3", "L5", "hip_center", "spine"),
    ("T12", "jL1T12", "L3", "spine", "spine"),
    ("T8", "jT9T8", "T12", "spine", "spine"),
    ("Neck", "jT1C7", "T8", "shoulder_center", "shoulder_center"),
    ("Head", "jC1Head", "Neck", "head", "shoulder_center"),
    *(
        row
        for side in ("Right", "Left")
        for s in (side.lower(),)
        for row in (
            (f"{side}Shoulder", f"j{side}T4Shoulder", "T8", "shoulder_center", "spine"),
            (f"{side}UpperArm", f"j{side}Shoulder", f"{side}Shoulder", f"shoulder_{s}", f"shoulder_{s}"),
            (f"{side}ForeArm", f"j{side}Elbow", f"{side}UpperArm", f"elbow_{s}", f"elbow_{s}"),
            (f"{side}Hand", f"j{side}Wrist", f"{side}ForeArm", f"wrist_{s}", f"wrist_{s}"),
        )
    ),
    *(
        row
        for side in ("Right", "Left")
        for s in (side.lower(),)
        for row in (
            (f"{side}UpperLeg", f"j{side}Hip", "Pelvis", f"hip_{s}", f"hip_{s}"),
            (f"{side}LowerLeg", f"j{side}Knee", f"{side}UpperLeg", f"knee_{s}", f"knee_{s}"),
            (f"{side}Foot", f"j{side}Ankle", f"{side}LowerLeg", f"ankle_{s}", f"ankle_{s}"),
            (f"{side}Toe", f"j{side}BallFoot", f"{side}Foot", f"foot_{s}", f"ankle_{s}"),
        )
    ),
)
_ARM = ("UpperArm", "ForeArm", "Hand")


def segments(shown: RigidWalk) -> tuple[Array, Array]:
    """Positions (T, 23, 3) and orientations (T, 23, 4), x y z w, of the segments; at rest in a T-pose."""
    world = forward_kinematics(shown.skeleton, np.zeros((*shown.rotations.shape[:2], 3)), shown.rotations)[1]
    places, turns = [], []
    for name, _, _, origin, node in TREE:
        turn = world[:, NODE_INDEX[node]]
        if name.endswith(_ARM):
            # From an arm that hangs down to one that is held out to its side.
            turn = multiply(
                turn, from_axis_angle("X", 0.5 * np.pi * (-1.0 if name.startswith("Left") else 1.0))
            )
        places.append(shown.joints[:, NODE_INDEX[origin]])
        turns.append(turn)
    return np.stack(places, axis=1), np.stack(turns, axis=1)


def document(frames: int = 90) -> list[str]:
    """The lines of the file."""
    shown = rigid_walk(frames, RATE)
    places, turns = segments(shown)
    own = leg_angles(shown.joints)
    joints = [row[1] for row in TREE[1:]]
    angles = np.zeros((frames, len(joints), 3))
    for side in ("Left", "Right"):
        angles[:, joints.index(f"j{side}Knee"), 2] = np.degrees(own[f"knee_{side.lower()}"])
        angles[:, joints.index(f"j{side}Hip"), 2] = np.degrees(own[f"hip_{side.lower()}"])

    def element(name: str, values: Array, digits: int) -> str:
        return f"<{name}>{' '.join(f'{value:.{digits}f}' for value in values.ravel())}</{name}>"

    def frame(number: int, kind: str, head: str) -> list[str]:
        return [
            f'<frame {head} type="{kind}">',
            element("orientation", turns[number][:, [3, 0, 1, 2]], 9),
            element("position", places[number], 9),
            *([element("jointAngle", angles[number], 6)] if kind == "normal" else []),
            "</frame>",
        ]

    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<mvnx version="4">',
        f'<subject label="walker" frameRate="{RATE:g}" segmentCount="{len(TREE)}">',
        "<segments>",
        *(f'<segment label="{row[0]}" id="{k + 1}"></segment>' for k, row in enumerate(TREE)),
        "</segments>",
        "<joints>",
    ]
    for name, joint, above, *_ in TREE[1:]:
        lines += [
            f'<joint label="{joint}"><connector1>{above}/{joint}</connector1>',
            f"<connector2>{name}/{joint}</connector2></joint>",
        ]
    lines += ["</joints>", f'<frames segmentCount="{len(TREE)}">', *frame(0, "tpose", 'time="0"')]
    for number, time in enumerate(shown.times):
        lines += frame(number, "normal", f'time="{1000.0 * time:.0f}" index="{number}"')
    return [*lines, "</frames>", "</subject>", "</mvnx>", ""]


def files(frames: int = 90) -> dict[str, bytes]:
    """One file."""
    return {"walk.mvnx": "\n".join(document(frames)).encode()}
