"""OpenSim's tables of markers (.sto): where a model has them, or where they were measured.

Below the line endheader are the columns' names and a row for each frame, with the time in s. A marker has
three columns, NAME_tx, NAME_ty and NAME_tz (as inverse kinematics reports a model's), or, with DataType=Vec3
in the header, one of three numbers with commas between them. Axes are those of a TRC; lengths are in metres
unless the header has Units.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.quality.rules.length_units import SET_BY_USER
from kinemimic.pipeline.readers.base.clip_building import reading
from kinemimic.pipeline.readers.base.column_names import index_of_columns
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import increasing_times
from kinemimic.pipeline.readers.base.numbers import parse_table
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.opensim.storage import ends_header, rows_cut_off, storage_header
from kinemimic.pipeline.readers.opensim.trc import WORLD_FROM_FILE
from kinemimic.pipeline.readers.optical.declared_unit import unit_named
from kinemimic.pipeline.readers.optical.marker_set import marker_set
from kinemimic.pipeline.readers.optical.markers import clip_of_markers
from kinemimic.pipeline.readers.optical.one_person import metres_of_one_person

FORMAT = Format(
    name="OpenSim .sto of markers",
    sensor="optical",
    holds="positions of markers",
    recognised_by="the keyword endheader, above columns NAME_tx, NAME_ty, NAME_tz or below DataType=Vec3",
    width_in_header=True,
)
_VECTORS = "datatype=vec3"
_AXES = ("_tx", "_ty", "_tz")
# A file of coordinates has a pelvis_tx, and models of several bodies a few more.
_FEWEST = 6
_MAX_TIME = 1e11  # s; times may count from 1970


def recognises(source: Source) -> bool:
    """True for a header that declares vectors, or for columns of the places of at least six markers."""
    lines = [line.strip().lower() for line in source.head]
    end = next((k for k, line in enumerate(lines) if ends_header(line)), None)
    if end is None:
        return False
    if any(line.replace(" ", "") == _VECTORS for line in lines[:end]):
        return True
    names = next((line.split() for line in lines[end + 1 :] if line), [])
    return len(_triples(names)) >= _FEWEST


def read(source: Source) -> Clip:
    """The clip of the nodes that the markers give (see markers.py); frames with an earlier time are dropped.

    Raises CaptureError for a damaged table, and markers from which legs cannot be computed.
    """
    header = storage_header(source)
    start = header.names_line + 1
    names = source.lines[header.names_line].split()
    if names[0].lower() != "time":
        raise source.error(expected="time as the first column", found=repr(names[0][:40]), line=start)
    if header.values.get("datatype", "").lower() == "vec3":
        columns = {name: [3 * k + 1, 3 * k + 2, 3 * k + 3] for k, name in enumerate(names[1:])}
        width = 1 + 3 * len(columns)
        numbers = source.with_text("\n".join(source.lines).replace(",", "\t"))
    else:
        index_of_columns(names, source, start)
        columns, width, numbers = _triples(names), len(names), source
    table = parse_table(numbers, start=start, width=width)
    clock = table.values[:, 0]
    known = np.abs(clock) < _MAX_TIME
    if not known.all():
        bad = int(np.argmin(known))
        raise source.error(expected="a time in s", found=f"{clock[bad]:g}", line=table.line(bad))
    later, defects = increasing_times(clock)
    defects += rows_cut_off(header, len(clock))
    labels = marker_set(source).renamed(tuple(columns), source)
    points = table.values[later][:, [k for places in columns.values() for k in places]]
    unit = source.unit or unit_named(header.values.get("units", "")) or "m"
    rows = np.flatnonzero(later)
    labels, points, wrong = metres_of_one_person(
        labels,
        points.reshape(len(points), -1, 3),
        unit,
        source,
        lambda row: table.where(int(rows[row])),
    )
    return clip_of_markers(
        labels,
        clock[later],
        points,
        format=FORMAT,
        reading=reading(
            units=unit,
            units_rule=SET_BY_USER if source.unit else "the format's",
            defects=[*defects, *wrong],
            columns=width,
            markers=[label for label in labels if label],
        ),
        world_from_file=WORLD_FROM_FILE,
        source=source,
    )


def _triples(names: list[str]) -> dict[str, list[int]]:
    """Marker -> its three columns, among these names."""
    index = {name.lower(): k for k, name in enumerate(names)}
    markers = [name[: -len(_AXES[0])] for name in names if name.lower().endswith(_AXES[0])]
    found = {marker: [index.get(marker.lower() + axis, -1) for axis in _AXES] for marker in markers}
    return {marker: columns for marker, columns in found.items() if min(columns) >= 0}
