"""Kinect v1 walks of Andersson and Araujo: one joint a line, `Name;x;y;z`, and no mark between frames.

A new frame starts wherever the first name comes again (Head, in the recorder's own sequence). There is no
clock and no tracking state: 30 frames a second are nominal. Metres, Y up.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.captures.format import Format
from kinemimic.pipeline.captures.frame_defects import refuse_far, zero_frames
from kinemimic.pipeline.captures.recording import clip_of_points, reading
from kinemimic.pipeline.captures.source import Source
from kinemimic.pipeline.clip import Clip
from kinemimic.pipeline.skeleton import NODES, node_skeleton

Array = NDArray[np.float64]

FORMAT = Format(
    name="Andersson lines",
    sensor="Kinect v1",
    holds="positions of 20 joints",
    told_by="lines `Head;x;y;z` with one joint's name each",
)
RATE = 30.0
# "hip_center" is Hip-centro in the file, "shoulder_left" is Shoulder-Left.
JOINTS: dict[str, str] = {node.title().replace("_", "-"): node for node in NODES if node != "hip_center"} | {
    "Hip-centro": "hip_center"
}
# What numbers are made of. Without it, a file of 20 names a frame is the same few bytes over and over.
_NUMERIC = b"0123456789.+-eE"
_ONE_LINE = bytes.maketrans(b"\n", b";")


def recognises(source: Source) -> bool:
    """True if two of the first three lines (one may be damaged) are a known joint's name and three fields."""
    lines = [line.split(";") for line in source.head[:3]]
    return sum(len(fields) == 4 and fields[0] in JOINTS for fields in lines) >= 2


def read(source: Source) -> Clip:
    """The clip of the 20 nodes at the nominal rate.

    CaptureError names the first line that is not the joint that is due, or if the last frame is cut off.
    """
    due = _sequence(source)
    points = _regular(source, due)
    if points is None:
        points = _line_by_line(source, due)
    refuse_far(points, due, source, lambda frame: frame * len(due) + 1)
    nodes = [JOINTS[name] for name in due]
    points = points[:, [nodes.index(node) for node in NODES]]
    return clip_of_points(
        node_skeleton(),
        np.arange(len(points)) / RATE,
        points,
        None,
        format=FORMAT,
        reading=reading(
            units="m",
            units_rule="the format's",
            defects=zero_frames(points),
            notes=[f"the file has no clock: {RATE:g} frames a second are the sensor's nominal rate"],
        ),
    )


def _sequence(source: Source) -> tuple[str, ...]:
    """The names of the first frame, in the sequence that all frames must have."""
    names: list[str] = []
    for number, line in enumerate(source.head, start=1):
        name = line.partition(";")[0].strip()
        if len(names) == len(JOINTS) or (names and name == names[0]):
            break
        if name in names or name not in JOINTS:
            found = f"{name[:40]!r}{' again' if name in names else ''}"
            raise source.error(expected="a joint's name", found=found, where=f"line {number}")
        names.append(name)
    if len(names) < len(JOINTS):
        missing = [name for name in JOINTS if name not in names]
        raise source.error(
            expected=f"{len(JOINTS)} joints in the first frame",
            found=f"{len(names)}, without {', '.join(missing[:3])}{' …' if len(missing) > 3 else ''}",
            where=f"line {len(names)}",
            advice="the file is cut off there" if len(names) == len(source.head) else None,
        )
    return tuple(names)


def _regular(source: Source, due: tuple[str, ...]) -> Array | None:
    """Points (T, 20, 3) of a file in which nothing is odd, or None: a line for a frame, then one parse.

    A loop over lines, each of three numbers, would take five times as long as this.
    """
    flat = source.content.translate(_ONE_LINE, b"\r")
    frame = "".join(f"{name};;;;" for name in due).encode().translate(None, _NUMERIC)
    names = flat.translate(None, _NUMERIC)
    frames, rest = divmod(len(names), len(frame))
    if rest or names != frames * frame:
        return None
    # The names are as they must be, but for digits in them: a frame begins at each first name, and the
    # parser steps over the others.
    records = flat.decode("ascii").split(f"{due[0]};")[1:]
    numbers = [4 * joint + axis for joint in range(len(due)) for axis in range(3)]
    try:
        rows = np.loadtxt(records, delimiter=";", usecols=numbers, comments=None, ndmin=2)
    except ValueError:
        return None
    return rows.reshape(-1, len(due), 3) if len(rows) == frames else None


def _line_by_line(source: Source, due: tuple[str, ...]) -> Array:
    """Points (T, 20, 3) of any file that can be read, or the CaptureError that says why it cannot."""
    filled = [(number, line) for number, line in enumerate(source.lines, start=1) if line.strip()]
    rows: list[list[float]] = []
    for index, (number, line) in enumerate(filled):
        name, *fields = (field.strip() for field in line.split(";"))
        wanted, where = due[index % len(due)], f"line {number}"
        if name != wanted:
            raise source.error(
                expected=f"{wanted} of frame {index // len(due)}",
                found=repr(name[:40]),
                where=where,
                advice="a joint's line is missing or there twice" if name in JOINTS else None,
            )
        if len(fields) != 3:
            cut = index == len(filled) - 1 and len(fields) < 3
            raise source.error(
                expected=f"{wanted} and 3 numbers",
                found=f"{len(fields)}",
                where=where,
                advice="the file is cut off there" if cut else None,
            )
        rows.append([_number(field, source, where) for field in fields])
    if len(rows) % len(due):
        raise source.error(
            expected=f"{len(due)} joints in the last frame",
            found=f"{len(rows) % len(due)}",
            where=f"line {filled[-1][0]}",
            advice="the file is cut off there",
        )
    return np.array(rows).reshape(-1, len(due), 3)


def _number(field: str, source: Source, where: str) -> float:
    try:
        if "_" not in field:
            return float(field)
    except ValueError:
        pass
    raise source.error(expected="a number", found=repr(field[:40]), where=where)
