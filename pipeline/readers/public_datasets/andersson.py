"""Kinect v1 walks of Andersson and Araujo: one joint per line, `Name;x;y;z`, without marks between frames.

A new frame starts where the first name recurs (Head, in the recorder's own order). There is no clock and no
tracking state: 30 Hz is nominal. Metres, Y up.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODES, node_skeleton
from kinemimic.pipeline.readers.base.clip_building import clip_of_points, reading
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import refuse_remote, zero_frames
from kinemimic.pipeline.readers.base.numbers import parse_table
from kinemimic.pipeline.readers.base.source import Source

FORMAT = Format(
    name="Andersson lines",
    sensor="Kinect v1",
    holds="positions of 20 joints",
    recognised_by="lines `Head;x;y;z` with one joint's name each",
)
RATE = 30.0
# "hip_center" is Hip-centro in the file, "shoulder_left" is Shoulder-Left.
NODE_OF_NAME: dict[str, str] = {
    node.title().replace("_", "-"): node for node in NODES if node != "hip_center"
} | {"Hip-centro": "hip_center"}
# The characters of numbers. Without them, a file of 20 names per frame repeats the same few bytes.
_NUMERIC = b"0123456789.+-eE"


def recognises(source: Source) -> bool:
    """True if two of the first three lines (one may be damaged) are a known joint's name and three fields."""
    lines = [line.split(";") for line in source.head[:3]]
    return sum(len(fields) == 4 and fields[0] in NODE_OF_NAME for fields in lines) >= 2


def read(source: Source) -> Clip:
    """The clip of the 20 nodes at the nominal rate.

    CaptureError names the first line that is not the expected joint, or reports that the last frame is cut
    off.
    """
    names_in_order = _names_of_first_frame(source)
    if not _is_regular(source, names_in_order):
        _check_lines(source, names_in_order)
    table = parse_table(source, width=4, separator=";", label_columns=1)
    points = table.values.reshape(-1, len(names_in_order), 3)
    refuse_remote(points, names_in_order, source, lambda frame: table.where(frame * len(names_in_order)))
    nodes = [NODE_OF_NAME[name] for name in names_in_order]
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
            notes=[f"the file has no clock: {RATE:g} Hz, the sensor's nominal rate"],
        ),
    )


def _names_of_first_frame(source: Source) -> tuple[str, ...]:
    """The names of the first frame, in the order that all frames must have."""
    names: list[str] = []
    for number, line in enumerate(source.head, start=source.blank_lines + 1):
        name = line.partition(";")[0].strip()
        if len(names) == len(NODE_OF_NAME) or (names and name == names[0]):
            break
        if name in names or name not in NODE_OF_NAME:
            found = f"{name[:40]!r}{' again' if name in names else ''}"
            raise source.error(expected="a joint's name", found=found, line=number)
        names.append(name)
    if len(names) < len(NODE_OF_NAME):
        missing = [name for name in NODE_OF_NAME if name not in names]
        raise source.error(
            expected=f"{len(NODE_OF_NAME)} joints in the first frame",
            found=f"{len(names)}, without {', '.join(missing[:3])}{' …' if len(missing) > 3 else ''}",
            line=source.blank_lines + len(names),
            advice="the file is cut off there" if len(names) == len(source.head) else None,
        )
    return tuple(names)


def _is_regular(source: Source, names_in_order: tuple[str, ...]) -> bool:
    """Whether all lines are the expected names in order, with three numbers each; even a space counts as
    irregular."""
    names = source.content.translate(None, _NUMERIC).rstrip(b"\n") + b"\n"
    frame = "".join(f"{name};;;\n" for name in names_in_order).encode().translate(None, _NUMERIC)
    return names == len(names) // len(frame) * frame


def _check_lines(source: Source, names_in_order: tuple[str, ...]) -> None:
    """Raise CaptureError for the first line that is not the expected joint with three fields."""
    filled = [(number, line) for number, line in enumerate(source.lines, start=1) if line.strip()]
    for index, (number, line) in enumerate(filled):
        name, *fields = (field.strip() for field in line.split(";"))
        wanted = names_in_order[index % len(names_in_order)]
        if name != wanted:
            raise source.error(
                expected=f"{wanted} of frame {index // len(names_in_order)}",
                found=repr(name[:40]),
                line=number,
                advice="a joint's line is missing or repeated" if name in NODE_OF_NAME else None,
            )
        if len(fields) != 3:
            cut_off = index == len(filled) - 1 and len(fields) < 3
            raise source.error(
                expected=f"{wanted} and 3 numbers",
                found=f"{len(fields)}",
                line=number,
                advice="the file is cut off there" if cut_off else None,
            )
    if len(filled) % len(names_in_order):
        raise source.error(
            expected=f"{len(names_in_order)} joints in the last frame",
            found=f"{len(filled) % len(names_in_order)}",
            line=filled[-1][0],
            advice="the file is cut off there",
        )
