"""Trajectories that Qualisys Track Manager exported (TSV).

Lines of a key and its values (NO_OF_FRAMES, FREQUENCY, MARKER_NAMES …), perhaps a line of column names
("Frame", "Time", "LASI X" …), then a line per frame: perhaps its number and time, and X, Y, Z of every marker
in millimetres. Cells of a marker that was not seen are empty, NULL or zero. Z is up in QTM's default axes.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import IDENTITY
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.quality.rules.length_units import SET_BY_USER
from kinemimic.pipeline.readers.base.clip_building import reading
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import zero_frames
from kinemimic.pipeline.readers.base.numbers import Table, is_empty, parse_sparse_table, to_number
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.optical.marker_set import marker_set
from kinemimic.pipeline.readers.optical.markers import clip_of_markers
from kinemimic.pipeline.readers.optical.one_person import metres_of_one_person

FORMAT = Format(
    name="Qualisys TSV",
    sensor="optical",
    holds="positions of markers",
    recognised_by="a line NO_OF_FRAMES and a line MARKER_NAMES",
    width_in_header=True,
    right_handed=True,
)
UNIT = "mm"
_FRAMES, _RATE, _MARKERS, _NAMES = "NO_OF_FRAMES", "FREQUENCY", "NO_OF_MARKERS", "MARKER_NAMES"
_KEY = re.compile(r"[A-Z][A-Z_]*")
_MAX_RATE = 10_000.0
_MOST_HEADER_LINES = 200
_ROWS = 1000  # that show the width of a table without names of columns


def recognises(source: Source) -> bool:
    """True if keys of the header are among the first lines."""
    keys = {line.partition("\t")[0].strip() for line in source.head}
    return _FRAMES in keys and bool({_NAMES, _MARKERS, "BODY_NAMES", "NO_OF_BODIES"} & keys)


def read(source: Source) -> Clip:
    """The clip of the nodes that the markers give (see markers.py).

    Raises CaptureError for a damaged header or table, rigid bodies without markers, and markers from which
    legs cannot be computed.
    """
    header, start, names = header_of(source)
    labels = tuple(name.strip() for name in header.get(_NAMES, ()))
    if not labels:
        raise source.error(
            expected=f"names of markers in {_NAMES}",
            found="rigid bodies only" if "BODY_NAMES" in header else "none",
            advice="export the trajectories (3D) from QTM",
        )
    rate = rate_of(header, source)
    table, values = _table(source, start, names, len(labels))
    labels = marker_set(source).renamed(labels, source)
    unit = source.unit or UNIT
    points = values.reshape(len(values), len(labels), 3)
    defects = zero_frames(points)
    labels, points, wrong = metres_of_one_person(labels, points, unit, source, table.where)
    defects += wrong
    defects += cut_off(header, len(points))
    return clip_of_markers(
        labels,
        np.arange(len(points)) / rate,
        points,
        format=FORMAT,
        reading=reading(
            units=unit,
            units_rule=SET_BY_USER if source.unit else "the format's",
            defects=defects,
            notes=["no axes in the file: read as Z up"],
            columns=table.values.shape[1],
            markers=[label for label in labels if label],
        ),
        world_from_file=IDENTITY,
        source=source,
    )


def header_of(source: Source) -> tuple[dict[str, list[str]], int, list[str]]:
    """Key -> its values, the line (from 0) on which the frames begin, and the names of their columns, if a
    line has them."""
    header: dict[str, list[str]] = {}
    for number, line in enumerate(source.lines[:_MOST_HEADER_LINES]):
        key, *values = line.rstrip("\t").split("\t")
        if _KEY.fullmatch(key.strip()):
            header.setdefault(key.strip(), values)
        elif number and any(_is_word(cell) for cell in (key, *values)):
            return header, number + 1, [key, *values]
        elif line.strip():
            return header, number, []
    raise source.error(expected="frames below the header", found="none")


def rate_of(header: Mapping[str, Sequence[str]], source: Source) -> float:
    """The rate in Hz that the header states; CaptureError without one."""
    stated = (header.get(_RATE) or [""])[0]
    rate = to_number(stated.replace(",", "."))
    if rate is None or not 0.0 < rate <= _MAX_RATE:
        raise source.error(expected=f"a rate in Hz in {_RATE}", found=repr(stated[:20]))
    return rate


def cut_off(header: Mapping[str, Sequence[str]], frames: int) -> list[Defect]:
    """The defect that the header declares more frames than there are."""
    stated = to_number((header.get(_FRAMES) or [""])[0])
    if stated is None or not frames < stated < 1e9:
        return []
    text = f"the header declares {stated:g} frames but the file has {frames}: it may be cut off"
    return [Defect("dropped_frames", int(stated) - frames, "frames", "flagged", text)]


def _is_word(cell: str) -> bool:
    return not is_empty(cell) and to_number(cell.replace(",", ".")) is None


def _table(source: Source, start: int, names: list[str], markers: int) -> tuple[Table, Array]:
    """The table, and the coordinates (T, 3 M) of its frames, which begin with neither, a number, or also a
    time; names: of the columns, if known."""
    rows = [line for line in source.lines[start : start + _ROWS] if line.strip()]
    # The cells of the last markers are empty where nothing was seen.
    width = len(names) or max((len(row.rstrip().split("\t")) for row in rows), default=0)
    leading = next((k for k in (0, 1, 2) if k + 3 * markers == width), None)
    if leading is None and rows and not names:
        # Nor are they seen in any of these rows, which then have a TAB at their end.
        leading = next((k for k in (2, 1, 0) if k + 3 * markers == len(rows[0].split("\t")) - 1), None)
    if leading is None:
        raise source.error(
            expected=f"three numbers for each of {markers} markers, and perhaps frame and time",
            found=f"{width}",
            line=start if names else start + 1,
        )
    table = parse_sparse_table(
        source, start=start, width=leading + 3 * markers, separator="\t", keep_empty_rows=True
    )
    return table, table.values[:, leading:]
