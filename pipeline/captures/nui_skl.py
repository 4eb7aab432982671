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
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.captures.numbers import Row, parse_rows
from kinemimic.pipeline.clip import Clip
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.rotations import Y_UP_TO_Z_UP, rotate
from kinemimic.pipeline.skeleton import MISSING, NODES, node_skeleton

Array = NDArray[np.float64]

FORMAT = "Kinect v1 .skl text"
FIELDS: tuple[str, ...] = ("X", "Y", "Z", "tracked")
# "hip_center" is HipCenter in the file.
JOINTS: tuple[str, ...] = tuple(node.title().replace("_", "") for node in NODES)
_COLUMN = re.compile(r"([a-z]+)_(x|y|z|tracked)$")
# A header with so many columns of joints is of this format, though some may be missing.
_ENOUGH_COLUMNS = 20
# The sensor sees 8 m far; its steps are 33 ms, and a slow recorder's up to three times as long.
FARTHEST = 100.0
STEPS = (0.005, 0.5)


def recognises(text: str) -> bool:
    """True if the first line is a header of joint columns."""
    header = text.lstrip().split("\n", 1)[0].lower().split()
    return sum(1 for name in header if _COLUMN.match(name)) >= _ENOUGH_COLUMNS


def read(text: str, path: Path) -> Clip:
    """The clip of the 20 nodes, one frame per line with a later time than the line before.

    Lines with a repeated or earlier time are dropped and counted in provenance["reading"].
    """
    lines = text.split("\n")
    first = next(number for number, line in enumerate(lines) if line.strip())
    header = lines[first].split()
    columns = _columns(header, path, first + 1)
    rows = [Row(number, line) for number, line in enumerate(lines[first + 1 :], first + 2) if line.strip()]
    if not rows:
        raise CaptureError(path, expected="frames below the header", found="none")
    values = parse_rows(rows, len(header), path)
    times = values[:, columns[0]] / 1000.0
    if not np.isfinite(times).all():
        bad = int(np.flatnonzero(~np.isfinite(times))[0])
        raise CaptureError(
            path, expected="a timestamp in ms", found="no finite number", where=f"line {rows[bad].number}"
        )
    joints = values[:, columns[1:]].reshape(len(rows), len(NODES), len(FIELDS))
    _check_states(joints[..., 3], rows, path)
    _check_places(joints[..., :3], rows, path)
    later = times > np.concatenate([[-np.inf], np.maximum.accumulate(times)[:-1]])
    step = float(np.median(np.diff(times[later]))) if later.sum() > 1 else STEPS[0]
    if not STEPS[0] <= step <= STEPS[1]:
        raise CaptureError(
            path,
            expected=f"timestamps in ms, with steps of {1e3 * STEPS[0]:g} to {1e3 * STEPS[1]:g}",
            found=f"a usual step of {1e3 * step:g}",
        )
    positions, states = _joints(joints[later])
    return Clip(
        skeleton=node_skeleton(),
        times=times[later],
        positions=positions,
        states=states,
        passes=np.zeros(int(later.sum()), dtype=np.int32),
        provenance={
            "format": FORMAT,
            "reading": {
                "units": "m",
                "units_rule": "the format's",
                "columns": len(header),
                "dropped_repeated_times": int((~later).sum()),
                "dropped_calibration_frames": 0,
                "notes": [],
            },
        },
    )


def _columns(header: Sequence[str], path: Path, line: int) -> list[int]:
    """Indices of the timestamp and of the 20 x 4 joint columns; CaptureError names those that are missing."""
    index = {name.lower(): column for column, name in enumerate(header)}
    where = f"line {line}"
    if len(index) != len(header):
        twice = sorted({name for name in header if [h.lower() for h in header].count(name.lower()) > 1})
        raise CaptureError(path, expected="column names once each", found=f"{twice[0]} twice", where=where)
    joints = {match.group(1) for name in index if (match := _COLUMN.match(name))}
    foreign = sorted(joints - {joint.lower() for joint in JOINTS})
    if foreign:
        raise CaptureError(
            path,
            expected="the 20 joints of a Kinect v1",
            found=f"{len(joints)} joints, among them {', '.join(foreign[:3])}",
            where=where,
            advice="a Kinect v2 recording is not read by this version" if len(joints) > len(JOINTS) else None,
        )
    wanted = ["timestamp", *(f"{joint}_{field}" for joint in JOINTS for field in FIELDS)]
    missing = [name for name in wanted if name.lower() not in index]
    if missing:
        more = f" and {len(missing) - 3} more" if len(missing) > 3 else ""
        raise CaptureError(
            path,
            expected="a timestamp and X, Y, Z, tracked of 20 joints",
            found=f"no column {', '.join(missing[:3])}{more}",
            where=where,
        )
    return [index[name.lower()] for name in wanted]


def _check_states(states: Array, rows: Sequence[Row], path: Path) -> None:
    wrong = ~np.isin(states, (0.0, 1.0, 2.0))
    if wrong.any():
        frame, joint = (int(k) for k in np.argwhere(wrong)[0])
        raise CaptureError(
            path,
            expected=f"0, 1 or 2 in {JOINTS[joint]}_tracked",
            found=f"{states[frame, joint]:g}",
            where=f"line {rows[frame].number}",
        )


def _check_places(places: Array, rows: Sequence[Row], path: Path) -> None:
    """Coordinates that no Kinect writes are damage; NaN and infinity are its way to say "not seen"."""
    wrong = np.isfinite(places) & (np.abs(np.where(np.isfinite(places), places, 0.0)) > FARTHEST)
    if wrong.any():
        frame, joint, axis = (int(k) for k in np.argwhere(wrong)[0])
        raise CaptureError(
            path,
            expected=f"metres, at most {FARTHEST:g}, in {JOINTS[joint]}_{FIELDS[axis]}",
            found=f"{places[frame, joint, axis]:g}",
            where=f"line {rows[frame].number}",
        )


def _joints(joints: Array) -> tuple[Array, NDArray[np.uint8]]:
    """Positions (T, 20, 3) in our world and states (T, 20); the sensor's origin is no joint's position."""
    positions, states = joints[..., :3].copy(), joints[..., 3].astype(np.uint8)
    unseen = (states == MISSING) | ~np.isfinite(positions).all(axis=-1) | (positions == 0.0).all(axis=-1)
    positions[unseen], states[unseen] = np.nan, MISSING
    return rotate(Y_UP_TO_Z_UP, positions), states
