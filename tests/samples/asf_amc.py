"""ASF/AMC as in the CMU library: lengths in inches times 0.45, bones with their own axes."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import IDENTITY, conjugate, from_euler, multiply
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from samples.motion import rigid_walk, y_up, y_up_turns

METRES = 0.0254 / 0.45
# bone: the bone above, the nodes at its start and end, the node whose rotation it has ("": it is fixed to
# the bone above), its axis in degrees (extrinsic XYZ, as in real files), its degrees of freedom.
BONES: dict[str, tuple[str, str, str, str, tuple[float, float, float], str]] = {
    "lowerback": ("root", "hip_center", "spine", "", (0, 0, 0), ""),
    "thorax": ("lowerback", "spine", "shoulder_center", "spine", (0, 0, 0), "rx ry rz"),
    "upperneck": ("thorax", "shoulder_center", "head", "shoulder_center", (10, 0, 0), "rx ry rz"),
}
for _s, _side, _sign in (("l", "left", 1.0), ("r", "right", -1.0)):
    _hip, _knee, _ankle, _foot, _shoulder, _elbow, _wrist, _hand = (
        f"{joint}_{_side}" for joint in ("hip", "knee", "ankle", "foot", "shoulder", "elbow", "wrist", "hand")
    )
    _three = "rx ry rz"
    BONES |= {
        f"{_s}hipjoint": ("root", "hip_center", _hip, "", (0, 0, 0), ""),
        f"{_s}femur": (f"{_s}hipjoint", _hip, _knee, _hip, (0, 0, 20 * _sign), _three),
        f"{_s}tibia": (f"{_s}femur", _knee, _ankle, _knee, (0, 0, 0), "rx"),
        f"{_s}foot": (f"{_s}tibia", _ankle, _foot, _ankle, (-90, 7.6, 20 * _sign), _three),
        f"{_s}clavicle": ("lowerback", "spine", _shoulder, "spine", (0, 0, 0), _three),
        f"{_s}humerus": (
            f"{_s}clavicle", _shoulder, _elbow, _shoulder, (180, 30 * _sign, 90 * _sign), _three,
        ),
        f"{_s}radius": (f"{_s}humerus", _elbow, _wrist, _elbow, (0, 40, 90 * _sign), _three),
        f"{_s}wrist": (f"{_s}radius", _wrist, _hand, _wrist, (0, 90 * _sign, 90), _three),
    }  # fmt: skip


def _axis(degrees: tuple[float, float, float]) -> Array:
    return from_euler(np.radians(degrees)[::-1], "ZYX")


def skeleton() -> str:
    """The text of the .asf file."""
    walk = rigid_walk(2)
    rest = {"hip_center": np.zeros(3)}
    for node, index in NODE_INDEX.items():
        if index:
            above = walk.skeleton.names[walk.skeleton.parents[index]]
            rest[node] = rest[above] + y_up(walk.skeleton.offsets[index]) / METRES
    lines = ["# AST/ASF file", ":version 1.10", ":name VICON", ":units", "  mass 1.0", "  length 0.45"]
    lines += ["  angle deg", ":documentation", "   made by a test", ":root", "   order TX TY TZ RX RY RZ"]
    lines += ["   axis XYZ", "   position 0 0 0  ", "   orientation 0 0 0 ", ":bonedata"]
    for number, (name, (_, start, end, _, axis, dofs)) in enumerate(BONES.items(), 1):
        bone = rest[end] - rest[start]
        length = float(np.linalg.norm(bone))
        direction = " ".join(f"{value:.9g}" for value in bone / length)
        lines += ["  begin", f"     id {number} ", f"     name {name}", f"     direction {direction} "]
        lines += [f"     length {length:.9g} ", f"     axis {' '.join(f'{a:g}' for a in axis)}  XYZ"]
        if dofs:
            lines += [f"    dof {dofs}", "    limits (-160.0 20.0)", *["           (-70.0 70.0)"] * 2]
        lines.append("  end")
    lines += [":hierarchy", "  begin"]
    for parent in ("root", *BONES):
        children = [name for name, bone in BONES.items() if bone[0] == parent]
        if children:
            lines.append(f"    {parent} {' '.join(children)}")
    return "\r\n".join([*lines, "  end", ""])


def channels(frames: int) -> dict[str, Array]:
    """Per bone of the file, its values (T, dofs)."""
    walk = rigid_walk(frames)
    turns = y_up_turns(walk.rotations)
    place = y_up(walk.root) / METRES
    values = {"root": np.concatenate([place, _angles(turns[:, 0], IDENTITY)], axis=1)}
    for name, (_, _, _, node, axis, dofs) in BONES.items():
        if dofs:
            values[name] = _angles(turns[:, NODE_INDEX[node]], _axis(axis))[:, : len(dofs.split())]
    return values


def _angles(turns: Array, axis: Array) -> Array:
    """Values rx, ry, rz (T, 3) in degrees of turns (T, 4) in the world's axes, for a bone of that axis."""
    own = multiply(multiply(conjugate(axis), turns), axis)
    return np.asarray(Rotation.from_quat(own).as_euler("ZYX", degrees=True))[:, ::-1]


def files(frames: int = 90) -> dict[str, bytes]:
    """07_01.amc, and 07.asf beside it."""
    values = channels(frames)
    lines = ["#!OML:ASF 07.ASF", ":FULLY-SPECIFIED", ":DEGREES"]
    for frame in range(frames):
        lines.append(str(frame + 1))
        lines += [
            f"{bone} {' '.join(f'{value:.6g}' for value in rows[frame])}" for bone, rows in values.items()
        ]
    return {"07_01.amc": "\n".join([*lines, ""]).encode(), "07.asf": skeleton().encode()}
