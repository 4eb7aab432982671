"""Joint columns from their names in the header, in common spellings: Head_X, LeftKnee.pos.x, X1, q_w …"""

from __future__ import annotations

import re
from dataclasses import dataclass

# A single letter counts only after a separator: the t of KneeLeft_X does not.
_ROTATION = r"rot(?:ation)?s?|euler|angle|(?<=[ _.\-:/])r"
_QUATERNION = r"quat(?:ernion)?|orient(?:ation)?|(?<=[ _.\-:/])q"
_POSITION = r"posi?(?:tion)?|loc(?:ation)?|trans(?:lation)?|(?<=[ _.\-:/])[pt]"
# What is no place and no turn.
_OTHER = r"(?<=[ _.\-:/])(?:vel(?:o(?:city)?)?|acc(?:e(?:l(?:eration)?)?)?|gyro|mag)"
_KIND = (
    rf"(?:(?P<rotation>{_ROTATION})|(?P<quaternion>{_QUATERNION})"
    rf"|(?P<position>{_POSITION})|(?P<other>{_OTHER}))"
)
_UNIT = r"(?:[ _]*[\[(](?![xyzw][\])])[^\])]*[\])]|[ _](?:mm|cm|m))?"
# Head_X, left_knee_x_mm, head.pos.x, Left Knee rotation Y (deg), joint0OrientationW, Head (x)
_AXIS_LAST = re.compile(
    rf"(?P<joint>.*?[^ _.\-:/(\[])[ _.\-:/]*(?:{_KIND}[ _.\-:/]*)?"
    rf"[(\[]?(?P<axis>[xyzw])[)\]]?{_UNIT}",
    re.IGNORECASE,
)
# X1, x_knee, z-17
_AXIS_FIRST = re.compile(rf"(?P<axis>[xyzw])[ _.\-:/]*(?P<joint>\d+|(?<=[ _.\-:/]).+?){_UNIT}", re.IGNORECASE)
_STATES = (
    r"(?:tracked|tracking[ _]?state|state|status|confidence(?:[ _]?level)?|conf|likelihood|score|visibility)"
)
_STATE = re.compile(rf"(?P<joint>.+?)[ _.\-:/]*{_STATES}", re.IGNORECASE)
# Of a table with a row per joint.
STATE = re.compile(rf"(?:joint[ _]?)?{_STATES}", re.IGNORECASE)
_SPACED_STATE = re.compile(r"(?P<joint>.+?)[ _.\-:/][sc]", re.IGNORECASE)
TIME = re.compile(
    r"(?:time|timestamp|t|zeit|temps|tiempo|seconds?|sec|ms|s)\b.*|.*time(?:stamp)?", re.IGNORECASE
)


@dataclass
class Columns:
    """Column indices of one joint, from 0: position and euler as (x, y, z), quaternion as (x, y, z, w)."""

    position: tuple[int, ...] = ()
    quaternion: tuple[int, ...] = ()
    euler: tuple[int, ...] = ()
    state: tuple[int, ...] = ()


def joints_of_header(names: tuple[str, ...]) -> dict[str, Columns]:
    """Columns of every joint that has a complete position, quaternion or triple of angles."""
    joints: dict[str, Columns] = {}
    for pattern in (_AXIS_LAST, _AXIS_FIRST):
        joints = _grouped(names, pattern)
        if joints:
            break
    lower = {joint.lower(): joint for joint in joints}
    for column, name in enumerate(names):
        match = _STATE.fullmatch(name) or _SPACED_STATE.fullmatch(name)
        if match and (joint := lower.get(match["joint"].lower())) is not None:
            joints[joint].state = (column,)
    return joints


def _is_right(name: str, match: re.Match[str], lower: set[str]) -> bool:
    """Whether the r before an axis is a side: knee_r_x is the right knee where there is also a knee_l_x."""
    start, end = match.span("rotation")
    return end - start == 1 and f"{name[:start]}l{name[end:]}".lower() in lower


def _grouped(names: tuple[str, ...], pattern: re.Pattern[str]) -> dict[str, Columns]:
    found: dict[str, dict[str, dict[str, int]]] = {}
    lower = {name.strip().lower() for name in names}
    for column, name in enumerate(map(str.strip, names)):
        match = pattern.fullmatch(name)
        if match is None or match.groupdict().get("other"):
            continue
        parts = match.groupdict()
        joint = parts["joint"]
        kind = next((kind for kind in ("rotation", "quaternion") if parts.get(kind)), "position")
        if kind == "rotation" and _is_right(name, match, lower):
            joint, kind = name[: match.end("rotation")], "position"
        axes = found.setdefault(joint, {}).setdefault(kind, {})
        axes.setdefault(parts["axis"].lower(), column)
    joints = {}
    for joint, kinds in found.items():
        joints[joint] = columns = Columns()
        for kind, axes in kinds.items():
            if set(axes) == set("xyzw"):
                columns.quaternion = tuple(axes[axis] for axis in "xyzw")
            elif set(axes) == set("xyz") and kind == "position":
                columns.position = tuple(axes[axis] for axis in "xyz")
            elif set(axes) == set("xyz"):
                columns.euler = tuple(axes[axis] for axis in "xyz")
    return {
        joint: columns
        for joint, columns in joints.items()
        if columns.position or columns.quaternion or columns.euler
    }
