"""OpenSim's marker files (.trc): a header of five or six lines, then frames, separated by TABs or by spaces.

Line 1 is PathFileType, lines 2 and 3 are names and values (DataRate, NumFrames, Units …), line 4 is Frame#,
Time and the markers' names, each above three columns, line 5 is X1 Y1 Z1 …, often followed by a blank line.
The cells of a marker that was not seen are empty, NaN or zero. Y is up, X forward and Z to the right,
OpenSim's axes.
"""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import from_axis_angle
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.quality.rules.length_units import SET_BY_USER
from kinemimic.pipeline.readers.base.clip_building import reading
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import increasing_times
from kinemimic.pipeline.readers.base.numbers import (
    Table,
    decimal_points,
    numbers_of,
    parse_sparse_table,
    parse_table,
)
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.optical.declared_unit import unit_named
from kinemimic.pipeline.readers.optical.marker_set import marker_set
from kinemimic.pipeline.readers.optical.markers import clip_of_markers
from kinemimic.pipeline.readers.optical.one_person import metres_of_one_person

FORMAT = Format(
    name="TRC",
    sensor="optical",
    holds="positions of markers",
    recognised_by="the word PathFileType and a line that begins with Frame# and Time",
    width_in_header=True,
)
# From X forward, Y up, Z right to X forward, Y left, Z up.
WORLD_FROM_FILE: Array = from_axis_angle("X", np.pi / 2.0)
# The Time column usually has three digits, 0.017 for 1/60. If it agrees with the declared rate to this
# precision (seconds), frame numbers over that rate are the better times.
_TIME_DIGITS = 0.0011
# Hz; and the longest median step in seconds of a column of times, beside a header that states a rate.
_HIGHEST_RATE, _SLOWEST = 1e5, 0.5
# The line of names begins with this; only Frame# is a mark of the format.
_FIRST_NAMES = re.compile(r"\s*frame\s*(#?)\s+time(?!\S)", re.IGNORECASE)


def recognises(source: Source) -> bool:
    """True if the first word is PathFileType, or a line of names begins with Frame# and Time."""
    names = (_FIRST_NAMES.match(line) for line in source.head[:8])
    return source.head[0].startswith("PathFileType") or any(found and found[1] for found in names)


def read(source: Source) -> Clip:
    """The clip of the nodes that the markers give (see markers.py); frames with an earlier time are dropped.

    Raises CaptureError for a damaged header or table, unknown units, and markers from which legs cannot be
    computed.
    """
    source = decimal_points(source, "\t")
    names_line = next((k for k, line in enumerate(source.lines[:16]) if _FIRST_NAMES.match(line)), None)
    if names_line is None:
        raise source.error(expected="a line that begins with Frame# and Time", found="none in the first 16")
    if "\t" not in source.lines[names_line]:
        source = _with_tabs(source)
    declared = _declared(source, names_line)
    stated_units = declared.get("units", "")
    units = source.unit or unit_named(stated_units)
    if units is None:
        raise source.error(
            expected="Units of mm, cm, m, dm, inch, ft in the header",
            found=repr(stated_units[:20]) if stated_units else "none",
            advice="set the unit with --unit",
        )
    # Below the names is X1 Y1 Z1 …; in a file without that line, the first frame is there.
    next_line = source.lines[names_line + 1] if names_line + 1 < len(source.lines) else ""
    table, values = _table(source, names_line + (1 if numbers_of(next_line, None) else 2))
    count = (values.shape[1] - 2) // 3
    labels = marker_set(source).renamed(_labels(source.lines[names_line], count), source)
    if not np.isfinite(values[:, 1]).all():
        bad = int(np.argmin(np.isfinite(values[:, 1])))
        raise source.error(expected="a time in s", found="none", line=table.line(bad))
    clock, notes = _clock(values[:, 1], declared)
    later, defects = increasing_times(clock)
    times, time_notes = _times(clock, later, declared, source)
    notes += time_notes
    kept = values if later.all() else values[later]
    points = kept[:, 2:].reshape(-1, count, 3)
    labels, points, wrong = metres_of_one_person(
        labels, points, units, source, lambda row: table.where(int(np.flatnonzero(later)[row]))
    )
    defects += wrong
    for key, found in (("numframes", len(values)), ("nummarkers", count)):
        stated = declared.get(key, "")
        if key == "numframes" and stated.isdecimal() and len(stated) < 9 and int(stated) > found:
            text = f"the header declares {stated} frames but the file has {found}: it may be cut off"
            defects.append(Defect("dropped_frames", int(stated) - found, "frames", "flagged", text))
        elif stated and stated != str(found):
            notes.append(f"the header declares {key} {stated[:20]}, the file has {found}")
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


def _with_tabs(source: Source) -> Source:
    """The file with a TAB for any white space: names of markers have no spaces, and no cell is empty."""
    lines = (_FIRST_NAMES.sub("Frame# Time", line) for line in source.lines)
    return source.with_text("\n".join("\t".join(line.split()) for line in lines))


def _declared(source: Source, names_line: int) -> dict[str, str]:
    """The header's pairs of (lower-case) name and value."""
    for k in range(names_line - 1):
        names = [name.strip().lower() for name in source.lines[k].split("\t")]
        if "units" in names or "datarate" in names:
            values = [value.strip() for value in source.lines[k + 1].split("\t")]
            # Some writers align the values under the names with a second TAB, which is not an empty value.
            if len(named := list(filter(None, names))) == len(given := list(filter(None, values))):
                names, values = named, given
            return dict(zip(names, values, strict=False))
    return {}


def _labels(line: str, count: int) -> tuple[str, ...]:
    """The markers' names, each above three columns; "" for a marker without a name.

    As many names as markers are theirs in order, however many TABs are between them.
    """
    fields = [field.strip() for field in line.split("\t")[2:]]
    if len(named := list(filter(None, fields))) == count:
        return tuple(named)
    labels = tuple(fields[: 3 * count : 3])
    return labels + ("",) * (count - len(labels))


def _table(source: Source, start: int) -> tuple[Table, Array]:
    """The frames (T, 2 + 3 M); empty cells become NaN.

    Most files have no empty cells, and searching for them takes half as long as parsing, so they are searched
    for only if the table cannot be parsed directly.
    """
    try:
        table = parse_table(source, start=start, separator="\t")
    except CaptureError:
        source = _with_trailing_cells(source, start)
        first = next((line for line in source.lines[start:] if line.strip()), "")
        table = parse_sparse_table(source, start=start, width=len(first.split("\t")), separator="\t")
    values = table.values
    spare = (values.shape[1] - 2) % 3
    if values.shape[1] < 5 or spare > 1 or (spare and np.isfinite(values[:, -1]).any()):
        raise source.error(
            expected="frame number, time and three numbers per marker",
            found=f"{values.shape[1]} numbers",
            line=table.line(0),
        )
    return table, values[:, : values.shape[1] - spare]


def _with_trailing_cells(source: Source, start: int) -> Source:
    """The file with the empty cells that some writers leave out at the end of a line, whole markers' only.

    Not in the last line, which may be cut off.
    """
    lines = source.lines[start:]
    width = max((len(line.split("\t")) for line in lines), default=0)
    last = max((k for k, line in enumerate(lines) if line.strip()), default=-1)
    filled = list(lines)
    for k, line in enumerate(lines[: max(last, 0)]):
        cells = line.rstrip("\t ").split("\t")
        if line.strip() and len(line.split("\t")) < width and len(cells) % 3 == 2:
            filled[k] = "\t".join([*cells, *[""] * (width - len(cells))])
    return source.with_text("\n".join([*source.lines[:start], *filled]))


def _rate(declared: dict[str, str]) -> float:
    """DataRate in Hz, 0 if there is none."""
    try:
        rate = float(declared.get("datarate", ""))
    except ValueError:
        return 0.0
    return rate if 0.0 < rate < _HIGHEST_RATE else 0.0


def _clock(clock: Array, declared: dict[str, str]) -> tuple[Array, list[str]]:
    """The Time column, unless it holds no times (zeros, or the frames' numbers), or too few digits for
    DataRate: then frames at DataRate."""
    rate, steps = _rate(declared), np.diff(clock)
    if not rate or not len(steps):
        return clock, []
    if _is_rounded(clock, rate):
        note = f"the Time column is rounded to hundredths or tenths: frames at the header's {rate:g} Hz"
        return clock[0] + np.arange(len(clock)) / rate, [note]
    if 0.0 < np.median(steps) < _SLOWEST * max(1.0, 1.0 / rate):
        return clock, []
    note = f"the Time column holds no times: frames at the header's {rate:g} Hz"
    return np.arange(len(clock)) / rate, [note]


def _is_rounded(clock: Array, rate: float) -> bool:
    """Whether times (T,) are those of frames at this rate, rounded to one or two digits, which do not suffice
    for it (as two do for 100 Hz)."""
    for unit in (0.1, 0.01):
        if np.abs(clock / unit - np.round(clock / unit)).max() < 1e-6:
            digits_suffice = abs(1.0 / rate / unit - round(1.0 / rate / unit)) < 1e-6
            apart = np.ptp(clock - np.arange(len(clock)) / rate)
            return not digits_suffice and bool(apart < 1.001 * unit)
    return False


def _times(
    clock: Array, later: NDArray[np.bool_], declared: dict[str, str], source: Source
) -> tuple[Array, list[str]]:
    """Seconds of the kept frames, and notes about them: the Time column takes precedence over DataRate."""
    rate, times = _rate(declared), clock[later]
    if rate:
        regular = times[0] + np.arange(len(times)) / rate
        if np.abs(regular - times).max() <= _TIME_DIGITS:
            return regular, []
    if len(times) > 1 and (np.median(np.diff(times)) > 1.0 or np.median(np.diff(times)) < 1e-4):
        raise source.error(
            expected="times in s, with steps of 0.0001 to 1",
            found=f"a median step of {np.median(np.diff(times)):g}",
        )
    step = f"{1.0 / np.median(np.diff(times)):.4g} Hz" if len(times) > 1 else "one frame"
    stated = f"states {rate:g} Hz" if rate else "states no rate"
    return times, [f"times are those of the Time column, {step}; the header {stated}"]
