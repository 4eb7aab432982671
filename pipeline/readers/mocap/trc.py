"""OpenSim's marker files (.trc): a header of five or six lines, then TAB-separated frames.

Line 1 PathFileType, lines 2 and 3 names and values (DataRate, NumFrames, Units …), line 4 Frame#, Time and
the markers' names, each above three columns, line 5 X1 Y1 Z1 …, then often a blank line. A marker that was
not seen leaves its cells empty, or zeros. Y is up, X forward and Z to the right, OpenSim's axes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import from_axis_angle
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.quality.rules.length_units import SET_BY_USER, UNITS
from kinemimic.pipeline.readers.base.clip_building import reading
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import increasing_times, refuse_remote
from kinemimic.pipeline.readers.base.numbers import Table, numbers_of, parse_table
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.mocap.declared_unit import in_metres
from kinemimic.pipeline.readers.mocap.markers import clip_of_markers

FORMAT = Format(
    name="TRC",
    sensor="optical",
    holds="positions of markers",
    recognised_by="the word PathFileType and a line that begins with Frame# and Time",
    width_in_header=True,
)
DECLARED: tuple[str, ...] = ("mm", "cm", "m")
# X forward, Y up, Z right: a quarter turn about X makes it X forward, Y left, Z up.
WORLD_FROM_FILE: Array = from_axis_angle("X", np.pi / 2.0)
# The Time column is mostly written with three digits, 0.017 for 1/60: if it agrees with the declared rate as
# far as it goes, frames over that rate are the better times.
_TIME_DIGITS = 0.0011


def recognises(source: Source) -> bool:
    """True if the first word is PathFileType, or a line of names begins with Frame# and Time."""
    return source.head[0].startswith("PathFileType") or _names(source.head[:8]) is not None


def read(source: Source) -> Clip:
    """The clip of the nodes that the markers show (see markers.py); frames with an earlier time are dropped.

    CaptureError for a damaged header or table, unknown units, and markers from which no legs follow.
    """
    at = _names(source.lines[:16])
    if at is None:
        raise source.error(expected="a line that begins with Frame# and Time", found="none in the first 16")
    declared = _declared(source, at)
    units = source.unit or declared.get("units", "").lower()
    if source.unit is None and units not in DECLARED:
        raise source.error(
            expected=f"Units of {', '.join(DECLARED)} in the header",
            found=repr(units[:20]) if units else "none",
            advice="--unit names the unit",
        )
    # Below the names stand X1 Y1 Z1 …; a file without that line has its first frame there.
    below = source.lines[at + 1] if at + 1 < len(source.lines) else ""
    table, values = _table(source, at + (1 if numbers_of(below, None) else 2))
    count = (values.shape[1] - 2) // 3
    labels = tuple(name.strip() for name in source.lines[at].split("\t")[2 : 2 + 3 * count : 3])
    labels += ("",) * (count - len(labels))
    if not np.isfinite(values[:, 1]).all():
        bad = int(np.argmin(np.isfinite(values[:, 1])))
        raise source.error(expected="a time in s", found="none", where=f"line {table.line(bad)}")
    later, defects = increasing_times(values[:, 1])
    times, notes = _times(values[:, 1], later, declared, source)
    kept = values if later.all() else values[later]
    points = (kept[:, 2:] * UNITS[units]).reshape(-1, count, 3)
    if source.unit is None:
        points, wrong = in_metres(labels, points)
        defects += wrong
    refuse_remote(points, labels, source, lambda row: table.line(int(np.flatnonzero(later)[row])))
    for key, found in (("numframes", len(values)), ("nummarkers", count)):
        told = declared.get(key, "")
        if key == "numframes" and told.isdecimal() and len(told) < 9 and int(told) > found:
            text = f"the header says {told} frames, {found} are there: the file may be cut off"
            defects.append(Defect("dropped_frames", int(told) - found, "frames", "flagged", text))
        elif told and told != str(found):
            notes.append(f"the header says {key} {told[:20]}, the file has {found}")
    return clip_of_markers(
        labels,
        times,
        points,
        format=FORMAT,
        reading=reading(
            units=units,
            units_rule=SET_BY_USER if source.unit else "the header's",
            defects=defects,
            notes=notes,
            columns=values.shape[1],
            markers=[label for label in labels if label],
        ),
        world_from_file=WORLD_FROM_FILE,
        source=source,
    )


def _names(lines: Sequence[str]) -> int | None:
    """Index of the line of the markers' names."""
    starts = (line.split("\t")[:2] for line in lines)
    return next(
        (k for k, start in enumerate(starts) if [f.strip() for f in start] == ["Frame#", "Time"]), None
    )


def _declared(source: Source, at: int) -> dict[str, str]:
    """The header's pairs of name (lower case) and value."""
    for k in range(at - 1):
        names = [name.strip().lower() for name in source.lines[k].split("\t")]
        if "units" in names or "datarate" in names:
            return dict(zip(names, (v.strip() for v in source.lines[k + 1].split("\t")), strict=False))
    return {}


def _table(source: Source, start: int) -> tuple[Table, Array]:
    """The frames, (T, 2 + 3 M); empty cells become NaN.

    Most files have none, and looking for them takes as long as half of the parsing: they are looked for
    where the table cannot be parsed as it stands.
    """
    try:
        table = parse_table(source, start=start, separator="\t")
    except CaptureError:
        body = sum(len(line) + 1 for line in source.lines[:start])
        frames = source.text[body:]
        for old, new in (("\t\t", "\tnan\t"), ("\t\t", "\tnan\t"), ("\t\n", "\tnan\n")):
            frames = frames.replace(old, new)
        frames += "nan" if frames.endswith("\t") else ""
        filled = Source(source.path, (source.text[:body] + frames).encode(), source.sha256)
        table = parse_table(filled, start=start, separator="\t")
    values = table.values
    spare = (values.shape[1] - 2) % 3
    if values.shape[1] < 5 or spare > 1 or (spare and np.isfinite(values[:, -1]).any()):
        raise source.error(
            expected="frame number, time and three numbers a marker",
            found=f"{values.shape[1]} numbers",
            where=f"line {table.line(0)}",
        )
    return table, values[:, : values.shape[1] - spare]


def _times(
    clock: Array, later: NDArray[np.bool_], declared: dict[str, str], source: Source
) -> tuple[Array, list[str]]:
    """Seconds of the frames that stay, and what is to be said of them: the Time column wins over DataRate."""
    try:
        rate = float(declared.get("datarate", ""))
    except ValueError:
        rate = 0.0
    times = clock[later]
    if 0.0 < rate < 1e5:
        even = times[0] + np.arange(len(times)) / rate
        if np.abs(even - times).max() <= _TIME_DIGITS:
            return even, []
    if len(times) > 1 and (np.median(np.diff(times)) > 1.0 or np.median(np.diff(times)) < 1e-4):
        raise source.error(
            expected="times in s, with steps of 0.0001 to 1",
            found=f"a usual step of {np.median(np.diff(times)):g}",
        )
    step = f"{1.0 / np.median(np.diff(times)):.4g} Hz" if len(times) > 1 else "one frame"
    told = f"says {rate:g} Hz" if 0.0 < rate < 1e5 else "names no rate"
    return times, [f"times are those of the Time column, {step}; the header {told}"]
