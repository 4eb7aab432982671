"""The markers of one person in metres, from those of a file."""

from __future__ import annotations

from collections.abc import Callable

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.quality.rules.length_units import UNITS
from kinemimic.pipeline.readers.base.frame_defects import refuse_remote
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.optical.declared_unit import in_metres
from kinemimic.pipeline.readers.optical.people import main_person


def metres_of_one_person(
    labels: tuple[str, ...],
    points: Array,
    unit: str,
    source: Source,
    where: Callable[[int], str] = lambda frame: f"frame {frame}",
) -> tuple[tuple[str, ...], Array, list[Defect]]:
    """Labels (N,) and points (T, N, 3) in metres without other people's, and the defects: those people, and a
    unit that the file does not have.

    labels: (M,); points: (T, M, 3), NaN or zeros where missing, in `unit`, a key of UNITS, which is checked
    unless the user named it; where: place of a frame in the file. Raises CaptureError for a coordinate that
    is no measurement.
    """
    labels, points, defects = main_person(labels, points * UNITS[unit])
    if source.unit is None:
        points, wrong_unit = in_metres(labels, points)
        defects += wrong_unit
        refuse_remote(points, labels, source, where, unit="m" if wrong_unit else unit)
    return labels, points, defects
