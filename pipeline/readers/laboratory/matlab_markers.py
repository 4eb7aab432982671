"""Markers in a MAT-file: as Qualisys Track Manager exports them, as the MoCap Toolbox of the University of
Jyväskylä stores them, in a variable or field for each marker (`matlab_variables.py`), or in a matrix with
names beside it (`matlab_matrix.py`).

QTM's structure has FrameRate and Trajectories.Labeled with Labels and Data (labels, 4, frames), the fourth
number an error; a recording without markers, as by Theia Markerless, has Skeletons with SegmentLabels and
PositionData (3, segments, frames). The toolbox's has freq, markerName and data (frames, 3 · markers). Both
are in millimetres, NaN where not seen; Z is up in the default axes of these programs.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.joint_names import REQUIRED, joints_by_name
from kinemimic.pipeline.kinematics.rotations import IDENTITY
from kinemimic.pipeline.quality.rules.length_units import SET_BY_USER
from kinemimic.pipeline.readers.array_files.mat5 import Value, field, heads, texts, variables
from kinemimic.pipeline.readers.base.clip_building import reading
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import zero_frames
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.laboratory import matlab_variables
from kinemimic.pipeline.readers.laboratory.matlab_matrix import named_matrix
from kinemimic.pipeline.readers.laboratory.matlab_variables import Recorded, first_number, is_array
from kinemimic.pipeline.readers.optical.declared_unit import likeliest_unit
from kinemimic.pipeline.readers.optical.marker_set import marker_set
from kinemimic.pipeline.readers.optical.markers import clip_of_markers
from kinemimic.pipeline.readers.optical.one_person import metres_of_one_person
from kinemimic.pipeline.readers.optical.people import has_legs

FORMAT = Format(
    name="markers in a MAT-file",
    sensor="optical",
    holds="positions of markers, or of a skeleton's segments",
    recognised_by="a structure of QTM or of the MoCap Toolbox, or a variable or field for each marker",
    binary=True,
    right_handed=True,
)
UNIT = "mm"
_QTM = ({"FrameRate", "Trajectories"}, {"FrameRate", "Skeletons"})
_TOOLBOX = {"freq", "markerName", "data"}
_MAX_RATE = 10_000.0


def recognises(source: Source) -> bool:
    """True if a variable is such a structure, or markers have variables or fields of their own, or names
    beside a matrix."""
    if _structures(source) or matlab_variables.holder(source) is not None:
        return True
    return named_matrix(source) is not None


def read(source: Source) -> Clip:
    """The clip of the nodes that the markers give (see markers.py), or of a skeleton's segments.

    Raises CaptureError for a damaged file, one without labelled markers, and markers from which legs cannot
    be computed.
    """
    structures = _structures(source)
    labels, points, times, stated, notes, of_times = (
        _of_structure(structures, source) if structures else matlab_variables.recorded(source)
    )
    unit = source.unit or stated or likeliest_unit(labels, points)
    defects = [*of_times, *zero_frames(points)]
    labels, points, wrong = metres_of_one_person(labels, points, unit, source)
    defects += wrong
    return clip_of_markers(
        labels,
        times,
        points,
        # Variables may be in the axes of anybody's own program.
        format=FORMAT if stated else replace(FORMAT, right_handed=False),
        reading=reading(
            units=unit,
            units_rule=SET_BY_USER if source.unit else "the format's" if stated else "the size of the body",
            defects=defects,
            notes=["no axes in the file: read as Z up", *notes],
            markers=[label for label in labels if label],
        ),
        world_from_file=IDENTITY,
        source=source,
    )


def _structures(source: Source) -> dict[str, int]:
    """Name -> number of recordings of the variables that are structures of QTM or the toolbox."""
    wanted = (*_QTM, _TOOLBOX)
    return {
        name: math.prod(head.shape)
        for name, head in heads(source).items()
        if any(fields <= set(head.fields) for fields in wanted)
    }


def _of_structure(structures: dict[str, int], source: Source) -> Recorded:
    """The first recording of the file."""
    name = next(iter(structures))
    value = variables(source, [name])[name]
    found = _of_toolbox(value, source) if field(value, "markerName") is not None else _of_qtm(value, source)
    if (count := sum(structures.values())) > 1:
        found = found._replace(notes=(*found.notes, f"{count} recordings in the file: the first is read"))
    return found


def _of_qtm(value: Value, source: Source) -> Recorded:
    """The labelled trajectories, else the segments of skeletons."""
    rate = _rate(field(value, "FrameRate"), "FrameRate", source)
    labels = texts(field(value, "Trajectories", "Labeled", "Labels"))
    chosen = marker_set(source)
    if not chosen.markers and not has_legs(labels) and (segments := _segments(value, rate, source)):
        return segments
    data = field(value, "Trajectories", "Labeled", "Data")
    if not labels:
        raise source.error(
            expected="labelled trajectories, or a skeleton with legs",
            found="none",
            advice="label them in QTM, or export the skeleton",
        )
    if not is_array(data) or data.ndim != 3 or len(data) != len(labels) or data.shape[1] not in (3, 4):
        raise source.error(expected=f"Data of shape ({len(labels)} labels, 4, frames)", found=_shape(data))
    points = np.moveaxis(data[:, :3].astype(np.float64), -1, 0)
    return _at_rate(chosen.renamed(labels, source), points, rate)


def _segments(value: Value, rate: float, source: Source) -> Recorded | None:
    """The segments of all skeletons that have legs, under their skeletons' names if there are several."""
    found = field(value, "Skeletons")
    people: dict[str, tuple[tuple[str, ...], Array]] = {}
    for number, skeleton in enumerate(found if isinstance(found, list) else [found]):
        names, data = texts(field(skeleton, "SegmentLabels")), field(skeleton, "PositionData")
        whole = is_array(data) and data.ndim == 3 and data.shape[:2] == (3, len(names))
        if not whole or not set(REQUIRED) <= joints_by_name(names).keys():
            continue
        if str(field(skeleton, "Reference") or "").strip().lower() == "local":
            raise source.error(
                expected="skeletons in global coordinates",
                found="Reference Local: each segment in its parent's axes",
                advice="export again with global coordinates",
            )
        points = np.moveaxis(data.astype(np.float64), (2, 1, 0), (0, 1, 2))
        people[str(field(skeleton, "SkeletonName") or f"skeleton {number + 1}")] = (names, points)
    if not people:
        return None
    labels = tuple(
        f"{name}:{segment}" if len(people) > 1 else segment
        for name, (segments, _) in people.items()
        for segment in segments
    )
    points = np.concatenate([points for _, points in people.values()], axis=1)
    return _at_rate(labels, points, rate, "a skeleton's segments are read as joints at their positions")


def _of_toolbox(value: Value, source: Source) -> Recorded:
    labels, data = texts(field(value, "markerName")), field(value, "data")
    if (order := first_number(field(value, "timederOrder"))) not in (None, 0.0):
        raise source.error(
            expected="positions (timederOrder 0)", found=f"their derivative of order {order:g}"
        )
    if not labels or not is_array(data) or data.ndim != 2 or data.shape[1] != 3 * len(labels):
        raise source.error(
            expected="names in markerName, and data of shape (frames, 3 for each of them)",
            found=f"{len(labels)} names and {_shape(data)}",
        )
    points = data.astype(np.float64).reshape(len(data), len(labels), 3)
    rate = _rate(field(value, "freq"), "freq", source)
    return _at_rate(marker_set(source).renamed(labels, source), points, rate)


def _at_rate(labels: tuple[str, ...], points: Array, rate: float, *notes: str) -> Recorded:
    return Recorded(labels, points, np.arange(len(points)) / rate, UNIT, notes)


def _rate(value: Value, name: str, source: Source) -> float:
    rate = first_number(value)
    if rate is None or not 0.0 < rate <= _MAX_RATE:
        raise source.error(
            expected=f"a rate in Hz in {name}", found="none" if rate is None else f"{rate:g}"[:20]
        )
    return rate


def _shape(value: Value) -> str:
    return str(value.shape)[:60] if is_array(value) else "none"
