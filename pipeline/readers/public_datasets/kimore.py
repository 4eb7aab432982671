"""KIMORE's joint positions of a Kinect v2: CSV without header or time, 25 times x, y, z, state.

Capecci et al., "The KIMORE dataset: KInematic assessment of MOvement and clinical scores for remote
monitoring of physical REhabilitation" (2019). A line is a frame of the sensor at 30 Hz and ends with a comma;
an empty line is a frame in which nobody was tracked, so files begin with dozens of them. Joints in the SDK's
order, metres, camera space. Some published copies were smoothed, including the states; their lines end with
an additional 0.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.readers.base.clip_building import clip_of_points, reading
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import MAX_COORDINATE, refuse_remote
from kinemimic.pipeline.readers.base.numbers import parse_table
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.kinect.kinect_v2 import FROM_SDK, SDK_JOINTS, kinect_v2_skeleton
from kinemimic.pipeline.readers.kinect.kinect_values import begins_with_rows, check_states

FORMAT = Format(
    name="KIMORE CSV",
    sensor="Kinect v2",
    holds="positions and states of 25 joints",
    recognised_by="comma-separated lines of 100 numbers, every fourth a state 0, 1 or 2",
    columns=(100, 101),
)
# In Hz. The file has no time; this is the sensor's rate.
RATE = 30.0
_WIDTH = 4 * len(SDK_JOINTS)


def recognises(source: Source) -> bool:
    """True if the first lines are 100 numbers (101 if smoothed) with states in every fourth column."""
    return begins_with_rows(source, ",", _is_frame)


def read(source: Source) -> Clip:
    """The clip of the 25 joints, one frame per line that is not empty, the first at 0 s.

    An empty line between frames takes 1/30 s: it is a gap in the times.
    """
    source = _without_bare_commas(source)
    lines = source.lines
    filled = np.array([number for number, line in enumerate(lines) if line.strip().strip(",")])
    if not len(filled):
        raise source.error(expected="frames", found="empty lines only")
    # From several lines, so that a damaged first line is reported as such.
    widths = [len(lines[number].strip().removesuffix(",").split(",")) for number in filled[:16]]
    width = _WIDTH + (widths.count(_WIDTH + 1) > widths.count(_WIDTH))
    table = parse_table(source, width=width, separator=",")

    def where(row: int) -> str:
        return f"line {filled[row] + 1}"

    frames = table.values[:, :_WIDTH].reshape(len(filled), len(SDK_JOINTS), 4)
    positions, states = frames[..., :3], frames[..., 3]
    refuse_remote(positions, SDK_JOINTS, source, where)
    notes = [f"no time in the file: {RATE:g} Hz, the sensor's rate"]
    if filled[0]:
        notes.append(f"{filled[0]} empty lines at the start: frames before anybody was tracked")
    if empty := int(filled[-1] - filled[0]) + 1 - len(filled):
        notes.append(f"{empty} empty lines between frames: nobody was tracked")
    if width > _WIDTH:
        states = np.rint(states)
        notes.append("smoothed before publication, including the states: the nearest state is taken")
    check_states(states, SDK_JOINTS, where, source)
    return clip_of_points(
        kinect_v2_skeleton(),
        (filled - filled[0]) / RATE,
        positions[:, FROM_SDK],
        states[:, FROM_SDK].astype(np.uint8),
        format=FORMAT,
        reading=reading(units="m", units_rule="the format's", notes=notes, columns=width),
    )


def _without_bare_commas(source: Source) -> Source:
    """The same lines, but those of commas only are empty: spreadsheets write empty lines like that."""
    if b"\n,," not in source.content and not source.content.startswith(b",,"):
        return source
    lines = (line if line.strip(" ,") else "" for line in source.lines)
    return source.with_text("\n".join(lines))


def _is_frame(row: list[float]) -> bool:
    if len(row) not in (_WIDTH, _WIDTH + 1):
        return False
    states = row[3:_WIDTH:4]
    if len(row) == _WIDTH:
        return all(state in (0.0, 1.0, 2.0) for state in states)
    # KinectReader's lines have the same length, but begin with a time and end with a state.
    return row[-1] == 0.0 and abs(row[0]) < MAX_COORDINATE and all(abs(state - 1.0) < 1.5 for state in states)
