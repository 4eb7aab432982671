"""Kinect v1 recordings as `.skl` text: a header line, then one line a frame.

Columns (any of the four variants with 81, 85, 86 or 91, and any sequence: they are found by name):
`timestamp` in ms on the Kinect's clock, optionally framenum, adc and gyro columns, then per joint of the SDK
`Name_X Name_Y Name_Z Name_tracked`, optionally `FloorPlane_A..D`. Positions are metres, Y up and already
referred to the floor: FloorPlane describes the camera, and applying it again would be wrong.
tracked: 0 not tracked, 1 inferred, 2 tracked.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.captures.format import Format
from kinemimic.pipeline.captures.numbers import Table, parse_table
from kinemimic.pipeline.captures.recording import clip_of_points, reading
from kinemimic.pipeline.captures.source import Source
from kinemimic.pipeline.clip import Clip
from kinemimic.pipeline.defect import Defect
from kinemimic.pipeline.skeleton import NODES, node_skeleton

Array = NDArray[np.float64]

FORMAT = Format(
    name="Kinect v1 .skl text",
    sensor="Kinect v1",
    holds="positions and states of 20 joints",
    told_by="a header of columns Name_X Name_Y Name_Z Name_tracked",
    columns=(81, 85, 86, 91),
)
FIELDS: tuple[str, ...] = ("X", "Y", "Z", "tracked")
# "hip_center" is HipCenter in the file.
JOINTS: tuple[str, ...] = tuple(node.title().replace("_", "") for node in NODES)
_COLUMN = re.compile(r"([a-z]+)_(x|y|z|tracked)$")
# A header with so many columns of joints is of this format, though some may be missing.
_ENOUGH_COLUMNS = 20
# The sensor sees 8 m far; its steps are 33 ms, and a slow recorder's up to three times as long.
FARTHEST = 100.0
STEPS = (0.005, 0.5)


def recognises(source: Source) -> bool:
    """True if the first line is a header of joint columns."""
    header = source.head[0].lower().split()
    return sum(1 for name in header if _COLUMN.match(name)) >= _ENOUGH_COLUMNS


def read(source: Source) -> Clip:
    """The clip of the 20 nodes, one frame per line with a later time than the line before.

    Lines with a repeated or earlier time are dropped and counted.
    """
    lines = source.lines
    first = next(number for number, line in enumerate(lines) if line.strip())
    header = lines[first].split()
    columns = _columns(header, source, first + 1)
    if not any(line.strip() for line in lines[first + 1 :]):
        raise source.error(expected="frames below the header", found="none")
    table = parse_table(source, start=first + 1, width=len(header))
    times = table.values[:, columns[0]] / 1000.0
    if not np.isfinite(times).all():
        bad = int(np.flatnonzero(~np.isfinite(times))[0])
        raise source.error(
            expected="a timestamp in ms", found="no finite number", where=f"line {table.line(bad)}"
        )
    joints = table.values[:, columns[1:]].reshape(len(times), len(NODES), len(FIELDS))
    _check_states(joints[..., 3], table, source)
    _check_places(joints[..., :3], table, source)
    later = times > np.concatenate([[-np.inf], np.maximum.accumulate(times)[:-1]])
    step = float(np.median(np.diff(times[later]))) if later.sum() > 1 else STEPS[0]
    if not STEPS[0] <= step <= STEPS[1]:
        raise source.error(
            expected=f"timestamps in ms, with steps of {1e3 * STEPS[0]:g} to {1e3 * STEPS[1]:g}",
            found=f"a usual step of {1e3 * step:g}",
        )
    repeated = int((~later).sum())
    defects = (
        []
        if not repeated
        else [
            Defect(
                "duplicate_frames",
                repeated,
                "frames",
                "repaired",
                f"{repeated} lines with the time of a line before, dropped",
            )
        ]
    )
    return clip_of_points(
        node_skeleton(),
        times[later],
        joints[later, :, :3],
        joints[later, :, 3].astype(np.uint8),
        format=FORMAT,
        reading=reading(units="m", units_rule="the format's", defects=defects, columns=len(header)),
    )


def _columns(header: Sequence[str], source: Source, line: int) -> list[int]:
    """Indices of the timestamp and of the 20 x 4 joint columns; CaptureError names those that are missing."""
    index = {name.lower(): column for column, name in enumerate(header)}
    where = f"line {line}"
    if len(index) != len(header):
        twice = sorted({name for name in header if [h.lower() for h in header].count(name.lower()) > 1})
        raise source.error(expected="column names once each", found=f"{twice[0]} twice", where=where)
    joints = {match.group(1) for name in index if (match := _COLUMN.match(name))}
    foreign = sorted(joints - {joint.lower() for joint in JOINTS})
    if foreign:
        raise source.error(
            expected="the 20 joints of a Kinect v1",
            found=f"{len(joints)} joints, among them {', '.join(foreign[:3])}",
            where=where,
            advice="a Kinect v2 recording is not read by this version" if len(joints) > len(JOINTS) else None,
        )
    wanted = ["timestamp", *(f"{joint}_{field}" for joint in JOINTS for field in FIELDS)]
    missing = [name for name in wanted if name.lower() not in index]
    if missing:
        more = f" and {len(missing) - 3} more" if len(missing) > 3 else ""
        raise source.error(
            expected="a timestamp and X, Y, Z, tracked of 20 joints",
            found=f"no column {', '.join(missing[:3])}{more}",
            where=where,
        )
    return [index[name.lower()] for name in wanted]


def _check_states(states: Array, table: Table, source: Source) -> None:
    wrong = ~np.isin(states, (0.0, 1.0, 2.0))
    if wrong.any():
        frame, joint = (int(k) for k in np.argwhere(wrong)[0])
        raise source.error(
            expected=f"0, 1 or 2 in {JOINTS[joint]}_tracked",
            found=f"{states[frame, joint]:g}",
            where=f"line {table.line(frame)}",
        )


def _check_places(places: Array, table: Table, source: Source) -> None:
    """Coordinates that no Kinect writes are damage; NaN and infinity are its way to say "not seen"."""
    wrong = np.isfinite(places) & (np.abs(np.where(np.isfinite(places), places, 0.0)) > FARTHEST)
    if wrong.any():
        frame, joint, axis = (int(k) for k in np.argwhere(wrong)[0])
        raise source.error(
            expected=f"metres, at most {FARTHEST:g}, in {JOINTS[joint]}_{FIELDS[axis]}",
            found=f"{places[frame, joint, axis]:g}",
            where=f"line {table.line(frame)}",
        )
