"""Skeletons that Qualisys Track Manager solved or received from Theia Markerless, and exported (TSV).

Lines of a key and its values, as in its trajectories (`qualisys_tsv.py`), but with REFERENCE and SOLVER; a
line of column names, in which every segment has its name, X, Y, Z in millimetres and QX, QY, QZ, QW; then a
line per frame, with an empty cell below each name.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import IDENTITY
from kinemimic.pipeline.quality.rules.length_units import SET_BY_USER
from kinemimic.pipeline.readers.base.clip_building import reading
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import zero_frames
from kinemimic.pipeline.readers.base.numbers import parse_sparse_table, to_number
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.laboratory.qualisys_tsv import UNIT, cut_off, header_of, rate_of
from kinemimic.pipeline.readers.optical.markers import clip_of_markers
from kinemimic.pipeline.readers.optical.one_person import metres_of_one_person

FORMAT = Format(
    name="Qualisys skeleton TSV",
    sensor="optical, or videos",
    holds="positions and rotations of a skeleton's segments",
    recognised_by="a line NO_OF_FRAMES and columns QX, QY, QZ, QW",
    width_in_header=True,
    right_handed=True,
)
_AXES, _ROTATIONS = ["X", "Y", "Z"], {"QX", "QY", "QZ", "QW"}
_MOST_HEADER_LINES = 16


def recognises(source: Source) -> bool:
    """True if the header and the columns of rotations are among the first lines."""
    keys = {line.partition("\t")[0].strip() for line in source.head}
    columns = [{cell.strip() for cell in line.split("\t")} for line in source.head[:_MOST_HEADER_LINES]]
    return "NO_OF_FRAMES" in keys and any(cells >= _ROTATIONS for cells in columns)


def read(source: Source) -> Clip:
    """The clip of the joints at the segments' positions.

    Raises CaptureError for a damaged header or table, positions in the axes of a parent, and segments without
    legs.
    """
    header, start, columns_named = header_of(source)
    names = [name.strip() for name in columns_named]
    reference = (header.get("REFERENCE") or [""])[0].strip().upper()
    if reference == "LOCAL":
        raise source.error(
            expected="REFERENCE GLOBAL",
            found="LOCAL: each segment in its parent's axes",
            advice="export again with global coordinates",
        )
    places = {
        name: range(column + 1, column + 4)
        for column, name in enumerate(names)
        if names[column + 1 : column + 4] == _AXES
    }
    if not places:
        raise source.error(expected="columns NAME, X, Y, Z of every segment", found="none", line=start)
    rate = rate_of(header, source)
    table = parse_sparse_table(source, start=start, width=len(names), separator="\t", keep_empty_rows=True)
    unit = source.unit or UNIT
    columns = [column for own in places.values() for column in own]
    points = table.values[:, columns].reshape(len(table.values), len(places), 3)
    defects = zero_frames(points)
    labels, points, wrong = metres_of_one_person(tuple(places), points, unit, source, table.where)
    defects += wrong
    return clip_of_markers(
        labels,
        np.arange(len(points)) / rate,
        points,
        format=FORMAT,
        reading=reading(
            units=unit,
            units_rule=SET_BY_USER if source.unit else "the format's",
            defects=[*defects, *cut_off(header, len(points))],
            notes=[
                "no axes in the file: read as Z up",
                "a skeleton's segments are read as joints at their positions; their rotations are not read",
                *_scale(header),
            ],
            columns=table.values.shape[1],
        ),
        world_from_file=IDENTITY,
        source=source,
    )


def _scale(header: Mapping[str, Sequence[str]]) -> list[str]:
    """The note that the skeleton was scaled, where it was."""
    stated = (header.get("SCALE") or [""])[0]
    return (
        [] if to_number(stated.replace(",", ".")) in (None, 1.0) else [f"SCALE {stated[:20]} is not applied"]
    )
