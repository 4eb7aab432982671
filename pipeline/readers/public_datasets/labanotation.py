"""KinectReader's recordings (Microsoft's LabanotationSuite): a time, then 25 times x, y, z, state.

Comma-separated without header, often with a trailing comma: the time in ticks of 100 ns, then the joints of a
Kinect v2 in the SDK's order, metres in camera space, state 0, 1 or 2.
"""

from __future__ import annotations

from itertools import pairwise
from statistics import median

import numpy as np

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.readers.base.clip_building import clip_of_points, reading
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import refuse_remote
from kinemimic.pipeline.readers.base.numbers import numbers_of, parse_table
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.kinect.kinect_v2 import FROM_SDK, SDK_JOINTS, kinect_v2_skeleton
from kinemimic.pipeline.readers.kinect.kinect_values import begins_with_rows, check_states, sensor_clock

FORMAT = Format(
    name="KinectReader CSV (Labanotation)",
    sensor="Kinect v2",
    holds="times, positions and states of 25 joints",
    recognised_by="comma-separated lines of 101 numbers: a whole number of ticks, then x, y, z, state",
    columns=(101,),
)
# Seconds per tick of .NET's TimeSpan, the unit of the SDK's clock.
TICK = 1e-7
_WIDTH = 1 + 4 * len(SDK_JOINTS)


def recognises(source: Source) -> bool:
    """True if the first lines are 101 numbers, the first a tick and every fourth after it a state.

    Steps below a thousandth of a second are those of frame numbers or milliseconds.
    """
    ticks = [row[0] for line in source.head[:16] if (row := numbers_of(line, ",")) and _is_frame(row)]
    steps = [after - before for before, after in pairwise(ticks) if after > before]
    return begins_with_rows(source, ",", _is_frame) and (not steps or median(steps) * TICK > 1e-3)


def read(source: Source) -> Clip:
    """The clip of the 25 joints, one frame per line with a later time than before."""
    table = parse_table(source, width=_WIDTH, separator=",")

    def where(row: int) -> str:
        return f"line {table.line(row)}"

    times = table.values[:, 0] * TICK
    frames = table.values[:, 1:].reshape(len(times), len(SDK_JOINTS), 4)
    check_states(frames[..., 3], SDK_JOINTS, where, source)
    refuse_remote(frames[..., :3], SDK_JOINTS, source, table.where)
    later, repeated = sensor_clock(times, where, source)
    kept = frames if later.all() else frames[later]
    return clip_of_points(
        kinect_v2_skeleton(),
        times[later],
        kept[:, FROM_SDK, :3],
        kept[:, FROM_SDK, 3].astype(np.uint8),
        format=FORMAT,
        reading=reading(units="m", units_rule="the format's", defects=repeated, columns=_WIDTH),
    )


def _is_frame(row: list[float]) -> bool:
    return len(row) == _WIDTH and row[0].is_integer() and all(state in (0.0, 1.0, 2.0) for state in row[4::4])
