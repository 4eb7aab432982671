"""Takes that OptiTrack's Motive exported (CSV, format version 1.x).

Line 1 has pairs of a key and its value (Format Version, Export Frame Rate, Length Units …). Below are lines
that say for each column its type (Bone, Marker, Rigid Body …), the name and ID of what it belongs to, whether
it is a rotation or a position, and X, Y, Z (and W, or an error), the last beside "Frame" and
"Time (Seconds)"; then a line per frame. A skeleton's bones are read at their joints; without a skeleton, the
named markers. Y is up in Motive's default axes.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.joint_names import REQUIRED, joints_by_name
from kinemimic.pipeline.kinematics.rotations import IDENTITY, Y_UP_TO_Z_UP
from kinemimic.pipeline.quality.rules.length_units import SET_BY_USER
from kinemimic.pipeline.readers.base.clip_building import reading
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import increasing_times
from kinemimic.pipeline.readers.base.numbers import parse_sparse_table, to_number
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.optical.declared_unit import unit_named
from kinemimic.pipeline.readers.optical.marker_set import marker_set
from kinemimic.pipeline.readers.optical.markers import clip_of_markers
from kinemimic.pipeline.readers.optical.one_person import metres_of_one_person

FORMAT = Format(
    name="OptiTrack Motive CSV",
    sensor="optical",
    holds="positions of a skeleton's bones, or of markers",
    recognised_by="a first line that begins with Format Version",
    width_in_header=True,
    right_handed=True,
)
_MARK = "Format Version"
_UNITS = ("Millimeters", "Centimeters", "Meters", "Inches", "Feet")
# Bones of Motive's skeletons -> the words by which joints are known (kinematics/joint_names.py).
_BONES = {
    "hip": "hips", "ab": "spine", "neck": "neck", "head": "head",
    **{
        f"{s}{bone}": f"{side}{word}"
        for s, side in (("l", "left"), ("r", "right"))
        for bone, word in (
            ("uarm", "upperarm"), ("farm", "forearm"), ("hand", "wrist"),
            ("thigh", "thigh"), ("shin", "shin"), ("foot", "ankle"), ("toe", "toe"),
        )
    },
}  # fmt: skip
# Of a marker that a take has as measured and as its skeleton's model has it, the measured one counts.
_BONE, _MARKERS = "bone", ("marker", "rigid body marker", "bone marker")
_MOST_HEADER_LINES = 12


def recognises(source: Source) -> bool:
    """True if the first line begins with Format Version."""
    return source.head[0].lstrip('"').startswith(_MARK)


def read(source: Source) -> Clip:
    """The clip of a skeleton's joints, or of the nodes that the markers give (see markers.py).

    Raises CaptureError for a damaged header or table, a take without bones and markers, and markers from
    which legs cannot be computed.
    """
    start = source.blank_lines
    facts = _facts(source.lines[start])
    unit = _unit(facts, source)
    axes_line, rows = _columns(source, start)
    axes = [cell.strip() for cell in source.lines[axes_line].split(",")]
    while axes and not axes[-1]:
        axes.pop()
    places, kind = _places(rows, axes)
    if not places:
        there = sorted({cell for cell in rows.get("type", [])[2:] if cell})
        raise source.error(
            expected="columns of a skeleton's bones or of markers",
            found=", ".join(there)[:80] or "frames and times only",
            advice="tick Markers or Skeletons in Motive's export settings",
        )
    space = facts.get("coordinate space", "Global")
    if kind == _BONE and space.lower() == "local":
        raise source.error(
            expected="the bones' positions in Coordinate Space Global",
            found=f"{space}: each in its parent's axes",
            advice="export again with Global coordinates",
        )
    table = parse_sparse_table(source, start=axes_line + 1, width=len(axes), separator=",")
    clock = table.values[:, 1]
    if not np.isfinite(clock).all():
        bad = int(np.argmin(np.isfinite(clock)))
        raise source.error(expected="a time in s", found="none", line=table.line(bad))
    later, defects = increasing_times(clock)
    times, notes = _times(clock[later], facts)
    labels = tuple(places)
    columns = [column for label in labels for column in places[label]]
    points = table.values[later][:, columns].reshape(-1, len(labels), 3)
    if kind == _BONE:
        notes.append("a skeleton's bones are read as joints at their positions; their rotations are not read")
    else:
        labels = marker_set(source).renamed(labels, source)
    lines = np.flatnonzero(later)
    labels, points, wrong = metres_of_one_person(
        labels, points, unit, source, lambda row: table.where(int(lines[row]))
    )
    defects += wrong
    y_up = space.lower() == "global"
    return clip_of_markers(
        labels,
        times,
        points,
        format=FORMAT,
        reading=reading(
            units=unit,
            units_rule=SET_BY_USER if source.unit else "the header's",
            defects=defects,
            notes=notes,
            columns=table.values.shape[1],
            version=facts.get(_MARK.lower(), "")[:20],
        ),
        world_from_file=Y_UP_TO_Z_UP if y_up else IDENTITY,
        source=source,
    )


def _facts(line: str) -> dict[str, str]:
    """The pairs of the first line, keys in lower case."""
    cells = [cell.strip().strip('"') for cell in line.split(",")]
    return {key.lower(): value for key, value in zip(cells[::2], cells[1::2], strict=False)}


def _unit(facts: dict[str, str], source: Source) -> str:
    stated = facts.get("length units", "")
    if source.unit is not None:
        return source.unit
    if (named := unit_named(stated)) is None:
        raise source.error(
            expected=f"Length Units of {', '.join(_UNITS)} in line 1",
            found=repr(stated[:20]) if stated else "none",
            advice="set the unit with --unit",
        )
    return named


def _columns(source: Source, start: int) -> tuple[int, dict[str, list[str]]]:
    """The line (from 0) of the axes, and the lines above: "type", "name", "property" -> a cell a column."""
    rows: dict[str, list[str]] = {}
    for number in range(start + 1, min(start + _MOST_HEADER_LINES, len(source.lines))):
        cells = [cell.strip().strip('"') for cell in source.lines[number].split(",")]
        if cells[0].lower() == "frame":
            return number, rows
        key = cells[1].lower() if len(cells) > 1 else ""
        if key in ("type", "name"):
            rows[key] = cells
        elif not key and any(cell in ("Position", "Rotation") for cell in cells):
            rows["property"] = cells
    raise source.error(expected="a line that begins with Frame, Time (Seconds)", found="none")


def _places(rows: dict[str, list[str]], axes: list[str]) -> tuple[dict[str, list[int]], str]:
    """Name -> columns of its X, Y, Z, of a skeleton's bones if it has legs, else of markers; and which."""
    found: dict[str, dict[str, list[int]]] = {kind: {} for kind in (_BONE, *_MARKERS)}
    types, names, kinds = (rows.get(key, []) for key in ("type", "name", "property"))
    for column, axis in enumerate(axes[: min(len(types), len(names), len(kinds))]):
        kind, name = types[column].lower(), names[column]
        if kinds[column] != "Position" or axis not in ("X", "Y", "Z") or kind not in found:
            continue
        if kind == _BONE:
            # A skeleton's name stays before its bones': a take may have several skeletons.
            skeleton, colon, bone = name.rpartition(":")
            name = f"{skeleton}{colon}{_BONES.get(bone.lower(), bone)}"
        found[kind].setdefault(name, []).append(column)
    whole = {
        kind: {name: columns for name, columns in places.items() if len(columns) == 3}
        for kind, places in found.items()
    }
    if set(REQUIRED) <= joints_by_name(tuple(whole[_BONE])).keys():
        return whole[_BONE], _BONE
    markers: dict[str, list[int]] = {}
    for kind in _MARKERS:
        for name, columns in whole[kind].items():
            markers.setdefault(name, columns)
    return (markers, _MARKERS[0]) if markers else (whole[_BONE], _BONE)


def _times(clock: Array, facts: dict[str, str]) -> tuple[Array, list[str]]:
    """Seconds of the frames: by the rate of the export where it agrees with the times, which have three
    digits."""
    rate = to_number(facts.get("export frame rate", "")) or 0.0
    if 0.0 < rate <= 10_000.0:
        regular = clock[0] + np.arange(len(clock)) / rate
        if np.abs(regular - clock).max() <= 0.0011:
            return regular, []
    return clock, ["times are those of the Time column"]
