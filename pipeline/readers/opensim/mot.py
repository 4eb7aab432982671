"""OpenSim motions (.mot, .sto, or the table as CSV): coordinates by name, on a standard adult's skeleton.

The file holds joint angles but no lengths: those used here are the published ones of the models with which
such files are made (legs and pelvis: Delp et al. 1990, as in gait2354; arms: Hamner, Seth & Delp 2010), 1.80
m tall; the angles do not depend on them. Coordinates are intrinsic Z-X-Y rotations of each joint (pelvis
tilt, list, rotation; hip flexion, adduction, rotation; lumbar extension, bending, rotation; the same for the
arm), of which the left side's second and third are mirrored. The file's world is X forward, Y up, Z right.
Further details of the model (skew axes of ankle and elbow, millimetres of gliding in the knee) are omitted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import from_axis_angle
from kinemimic.pipeline.kinematics.skeleton import Skeleton
from kinemimic.pipeline.plural import plural
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.readers.base.clip_building import clip_of_channels, reading
from kinemimic.pipeline.readers.base.column_names import index_of_columns
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import increasing_times
from kinemimic.pipeline.readers.base.numbers import Table, parse_table
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.opensim.storage import ends_header, rows_cut_off, storage_header

FORMAT = Format(
    name="OpenSim .mot/.sto",
    sensor="optical, through inverse kinematics",
    holds="joint angles of an OpenSim model by name",
    recognised_by="the keyword endheader, or a first line with the coordinates' names",
    width_in_header=True,
)
ORDER = "ZXY"
# From X forward, Y up, Z right to X forward, Y left, Z up.
WORLD_FROM_FILE: Array = from_axis_angle("X", np.array(0.5 * np.pi))
# Height in metres of the pelvis' origin above the floor in standing, for files without it.
STANDING = 0.94
PELVIS_POSITION: tuple[str, ...] = ("pelvis_tx", "pelvis_ty", "pelvis_tz")
REQUIRED: tuple[str, ...] = ("hip_flexion_r", "knee_angle_r", "hip_flexion_l", "knee_angle_l")
# Radians of a full turn, and of a knee's range in walking.
_FULL_TURN, _MOVING_KNEE = 2.0 * np.pi, 0.5
# Percentile of the magnitudes of an angle that stands for the largest: one damaged number is not evidence.
_MOST = 95.0
# Radians, metres and seconds; larger values are damage.
_MAX_ANGLE, _MAX_POSITION, _MAX_TIME = 100.0, 1e4, 1e6


class _Joint(NamedTuple):
    """A joint: its parent, its offset in the parent's frame (metres), and the coordinates of its rotations
    about Z, X, Y.

    requires: the joint is omitted if the file lacks this coordinate, as nothing is known about it then.
    """

    name: str
    parent: str
    offset: tuple[float, float, float]
    angle_names: tuple[str, str, str] = ("", "", "")
    requires: str = ""


def _leg(side: str, s: str, right: float) -> tuple[_Joint, ...]:
    hip = (f"hip_flexion_{s}", f"hip_adduction_{s}", f"hip_rotation_{s}")
    return (
        _Joint(f"hip_{side}", "pelvis", (-0.0707, -0.0661, 0.0835 * right), hip),
        _Joint(f"knee_{side}", f"hip_{side}", (0.0, -0.396, 0.0), (f"knee_angle_{s}", "", "")),
        _Joint(f"ankle_{side}", f"knee_{side}", (0.0, -0.43, 0.0), (f"ankle_angle_{s}", "", "")),
        _Joint(f"foot_{side}", f"ankle_{side}", (0.130, -0.044, 0.009 * right)),
    )


def _arm(side: str, s: str, right: float) -> tuple[_Joint, ...]:
    arm, elbow = f"arm_flex_{s}", f"elbow_flex_{s}"
    angle_names = (arm, f"arm_add_{s}", f"arm_rot_{s}")
    return (
        _Joint(
            f"shoulder_{side}", "lumbar", (0.003155, 0.3715, 0.17 * right), angle_names, "lumbar_extension"
        ),
        _Joint(f"elbow_{side}", f"shoulder_{side}", (0.0131, -0.2863, -0.0096 * right), (elbow, "", ""), arm),
        _Joint(f"wrist_{side}", f"elbow_{side}", (-0.0155, -0.2488, 0.0397 * right), requires=elbow),
    )


# The midpoint of the hips and a point straight above it, both fixed to the pelvis, show its frame.
OPENSIM_JOINTS: tuple[_Joint, ...] = (
    _Joint("pelvis", "", (0.0, 0.0, 0.0), ("pelvis_tilt", "pelvis_list", "pelvis_rotation")),
    _Joint("hip_center", "pelvis", (-0.0707, -0.0661, 0.0)),
    _Joint("spine", "pelvis", (-0.0707, 0.0815, 0.0)),
    _Joint(
        "lumbar",
        "pelvis",
        (-0.1007, 0.0815, 0.0),
        ("lumbar_extension", "lumbar_bending", "lumbar_rotation"),
        "lumbar_extension",
    ),
    *_arm("left", "l", -1.0),
    *_arm("right", "r", 1.0),
    *_leg("left", "l", -1.0),
    *_leg("right", "r", 1.0),
)


def recognises(source: Source) -> bool:
    """True if a line is endheader, or the first line has the names of the legs' coordinates."""
    names = set(map(_coordinate, _cells(source.head[0])))
    return any(ends_header(line) for line in source.head) or names >= set(REQUIRED)


def read(source: Source) -> Clip:
    """The clip of the joints that the file's coordinates move, each with Euler channels.

    Rows whose time is not later than before are dropped and reported. angles: the file's own knees and hips.
    """
    table = _table(source)
    later, defects = increasing_times(table.times)
    defects = [*table.defects, *defects]
    values = {name: column[later] for name, column in table.columns.items()}
    knee_sign, knee_rule = _knee_sign(values)

    joints = [joint for joint in OPENSIM_JOINTS if not joint.requires or joint.requires in values]
    names = tuple(joint.name for joint in joints)
    parents = tuple(names.index(joint.parent) if joint.parent else -1 for joint in joints)
    skeleton = Skeleton(names, parents, np.array([joint.offset for joint in joints]))
    euler, orders = _channels(joints, values, knee_sign)
    translations = np.broadcast_to(skeleton.offsets, euler.shape).copy()
    zeros = np.zeros(len(euler))
    default = {"pelvis_ty": zeros + STANDING}
    translations[:, 0] = np.stack(
        [values.get(name, default.get(name, zeros)) for name in PELVIS_POSITION], axis=-1
    )
    missing_positions = [name for name in PELVIS_POSITION if name not in values]
    notes = [
        "the file holds no lengths: an adult of 1.80 m is assumed (Delp et al. 1990, Hamner et al. 2010)",
        knee_rule,
        *(
            [f"no {', '.join(missing_positions)} in the file: the pelvis does not move along it"]
            if missing_positions
            else []
        ),
    ]
    angles = {
        f"{joint}_{side}": sign * values[f"{column}_{side[0]}"]
        for joint, column, sign in (("knee", "knee_angle", knee_sign), ("hip", "hip_flexion", 1.0))
        for side in ("left", "right")
    }
    return clip_of_channels(
        skeleton,
        table.times[later] - table.times[0],
        translations,
        euler,
        orders,
        format=FORMAT,
        reading=reading(
            units="m", units_rule="the format's", defects=defects, notes=notes, columns=table.width
        ),
        world_from_file=WORLD_FROM_FILE,
        angles=angles,
    )


@dataclass(frozen=True)
class _Table:
    """times: (T,) seconds; columns: coordinate -> (T,), radians and metres; width: number of columns in the
    file; defects: an angles' unit that is not the declared one, rows left out or cut off."""

    times: Array
    columns: Mapping[str, Array]
    width: int
    defects: list[Defect]


def _table(source: Source) -> _Table:
    header = storage_header(source)
    start = header.names_line
    labels = [_coordinate(label) for label in _cells(source.lines[start])]
    _check_labels(labels, source, start + 1)
    separator = _separator(source.lines[start])
    table = parse_table(source, start=start + 1, width=len(labels), separator=separator)
    angle_names = {name for joint in OPENSIM_JOINTS for name in joint.angle_names if name} & set(labels)
    used = [k for k, label in enumerate(labels) if label in {"time", *PELVIS_POSITION, *angle_names}]
    rows, left_out = _whole_rows(table, used, labels, source)
    columns = {labels[k]: table.values[rows, k] for k in used}
    angles = {name: columns[name] for name in angle_names}
    in_degrees, defects = _in_degrees(header.values.get("indegrees", ""), angles)
    defects += left_out
    if in_degrees:
        columns |= {name: np.radians(columns[name]) for name in angle_names}
    units = {"time": ("s", _MAX_TIME), **dict.fromkeys(PELVIS_POSITION, ("m", _MAX_POSITION))}
    for label, values in columns.items():
        unit, limit = units.get(label, ("rad", _MAX_ANGLE))
        if np.abs(values).max() > limit:
            row = int(np.argmax(np.abs(values)))
            raise source.error(
                expected=f"at most {limit:g} {unit} in {label}",
                found=f"{values[row]:g}",
                line=table.line(int(rows[row])),
            )
    defects += rows_cut_off(header, len(table.values))
    return _Table(columns.pop("time"), columns, len(labels), defects)


def _whole_rows(
    table: Table, used: Sequence[int], labels: Sequence[str], source: Source
) -> tuple[NDArray[np.intp], list[Defect]]:
    """The rows with a number in every used column, and a defect that counts the others: the kinematics need
    every joint. CaptureError if there are none."""
    known = np.isfinite(table.values[:, used])
    whole: Mask = np.asarray(known.all(axis=1))
    if whole.all():
        return np.arange(len(known)), []
    row = int(np.argmin(whole))
    column = used[int(np.argmin(known[row]))]
    if not whole.any():
        raise source.error(
            expected=f"a finite number in {labels[column]}",
            found=f"{table.values[row, column]}",
            line=table.line(row),
        )
    count = int((~whole).sum())
    text = f"{plural(count, 'row')} without a number in {labels[column]} or another coordinate, left out"
    return np.flatnonzero(whole), [Defect("dropped_frames", count, "frames", "flagged", text)]


def _separator(names: str) -> str | None:
    """A comma, as in a CSV, or None for white space."""
    return "," if "," in names else None


def _cells(names: str) -> list[str]:
    return [name.strip().strip('"') for name in names.split(_separator(names))]


def _coordinate(label: str) -> str:
    """A column's coordinate; OpenSim 4 writes states as /jointset/hip_r/hip_flexion_r/value, others Time."""
    if label.lower() == "time":
        return "time"
    parts = label.split("/")
    return parts[-2] if len(parts) > 2 and parts[-1] == "value" else label


def _check_labels(labels: Sequence[str], source: Source, line: int) -> None:
    missing = [name for name in REQUIRED if name not in labels]
    if missing:
        labels_shown = ", ".join(labels[:6]) + (" …" if len(labels) > 6 else "")
        raise source.error(
            expected=f"columns {', '.join(REQUIRED)}",
            found=f"no {', '.join(missing)} among {labels_shown[:200]}",
            line=line,
            advice="forces and muscle states are not motion: pass the file of inverse kinematics",
        )
    if labels[0] != "time":
        raise source.error(expected="time as the first column", found=repr(labels[0][:40]), line=line)
    index_of_columns(labels, source, line)


def _in_degrees(declared: str, angles: Mapping[str, Array]) -> tuple[bool, list[Defect]]:
    """Whether the angles are in degrees, and a defect if the header says otherwise.

    Hips and knees beyond a full turn in radians are in degrees. Where every joint stays within half a turn in
    radians although the knees move as far as they do in walking, the angles are in radians: in degrees, that
    would be a body that stands within three degrees of the model's zero, and still.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # a damaged file may hold any number
        size = {name: float(np.percentile(np.abs(angle), _MOST)) for name, angle in angles.items()}
        knees = [np.ptp(np.percentile(angles[f"knee_angle_{s}"], [100.0 - _MOST, _MOST])) for s in "lr"]
    legs = [name for name in REQUIRED if size[name] > _FULL_TURN]
    if declared.lower() not in ("yes", "no"):
        return max(size.values()) > _FULL_TURN, []
    in_degrees = declared.lower() == "yes"
    largest = max(size.values())
    if in_degrees and max(knees) > _MOVING_KNEE and largest < 0.5 * _FULL_TURN:
        text = f"declared in degrees, but none exceeds {largest:.2f}: read in radians"
    elif not in_degrees and legs:
        text = f"declared in radians, but {legs[0]} reaches {size[legs[0]]:.0f}: read in degrees"
    else:
        return in_degrees, []
    found = Defect("wrong_units", len(angles), "angles", "repaired", f"angles are {text}")
    return not in_degrees, [found]


def _knee_sign(values: Mapping[str, Array]) -> tuple[float, str]:
    """The factor that makes knee flexion positive, and how it is known.

    A knee flexes far to one side and over-extends by a few degrees at most; models differ in the sign.
    """
    knees = np.concatenate([values["knee_angle_r"], values["knee_angle_l"]])
    negative = -float(knees.min()) > float(knees.max())
    rule = (
        f"knee_angle is {'negative' if negative else 'positive'} in flexion, inferred from its larger values"
    )
    return (-1.0 if negative else 1.0), rule


def _channels(
    joints: Sequence[_Joint], values: Mapping[str, Array], knee_sign: float
) -> tuple[Array, tuple[str, ...]]:
    """Angles (T, J, 3) in radians in the sequence of ORDER, zeros for coordinates that the file lacks; orders
    (J,)."""
    frames = len(next(iter(values.values())))
    euler = np.zeros((frames, len(joints), 3))
    orders: list[str] = []
    for j, joint in enumerate(joints):
        for k, coordinate in enumerate(joint.angle_names):
            if coordinate in values:
                # On the left, X and Y point the other way in the body; a shin swings backward about -Z.
                mirrored = k > 0 and joint.name.endswith("_left")
                sign = -knee_sign if coordinate.startswith("knee") else -1.0 if mirrored else 1.0
                euler[:, j, k] = sign * values[coordinate]
        orders.append(ORDER if any(coordinate in values for coordinate in joint.angle_names) else "")
    return euler, tuple(orders)
