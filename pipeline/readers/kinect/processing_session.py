"""Sessions that a Processing sketch (KinectV2_SkeletonTools) saves: a header, positions and orientations.

White space between; columns are found by name: frameCount, about twelve features of the sketch's own (not
read), then joint0 to joint24 in the SDK's order, each PositionX/Y/Z in metres in camera space and
OrientationW/X/Y/Z, w first, absolute. There is no time and there are no states. The sketch smoothed one of
the two: a joint's +Y axis keeps to its bone within a few degrees at the trunk and the legs, but in fast arms
they part.
"""

from __future__ import annotations

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import Y_UP_TO_Z_UP
from kinemimic.pipeline.readers.base.absolute_orientations import child_to_parent
from kinemimic.pipeline.readers.base.clip_building import clip_of_points, reading
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import refuse_remote
from kinemimic.pipeline.readers.base.numbers import parse_table
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.kinect.kinect_v2 import FROM_SDK, SDK_JOINTS, kinect_v2_skeleton
from kinemimic.pipeline.readers.kinect.kinect_values import check_quaternions, sensor_clock

FORMAT = Format(
    name="Processing session",
    sensor="Kinect v2",
    holds="positions and orientations of 25 joints",
    recognised_by="a header with frameCount and columns joint0PositionX … joint24OrientationZ",
    columns=(188,),
)
# A frame of the sketch is a frame of the sensor.
RATE = 30.0
_CLOCK = "frameCount"
# Our sequence of a quaternion's parts: x, y, z, w.
_FIELDS = tuple(f"Position{axis}" for axis in "XYZ") + tuple(f"Orientation{part}" for part in "XYZW")


def recognises(source: Source) -> bool:
    """True if the first line is a header with the frame count and the joints' positions."""
    names = source.head[0].split()
    return _CLOCK in names and sum(name.startswith("joint") and "Position" in name for name in names) >= 20


def read(source: Source) -> Clip:
    """The clip of the 25 joints with rotations, one frame per whole line with a higher count."""
    names, line = source.head[0].split(), source.blank_lines + 1
    columns = _columns(names, source, line)
    table = parse_table(source, start=line, width=len(names), drop_other_widths=True)

    def where(row: int) -> str:
        return f"line {table.line(row)}"

    times = table.values[:, columns[0]] / RATE
    later, repeated = sensor_clock(times, where, source)
    frames = table.values[:, columns[1:]].reshape(len(times), len(SDK_JOINTS), len(_FIELDS))
    refuse_remote(frames[..., :3], SDK_JOINTS, source, table.line)
    check_quaternions(frames[..., 3:], SDK_JOINTS, where, source)
    frames = frames if later.all() else frames[later]
    notes = [f"no time in the file: the sketch's frame count at {RATE:g} frames a second"]
    if table.dropped:
        notes.append(f"{table.dropped} lines with more or fewer numbers than the header, left out")
    skeleton = kinect_v2_skeleton()
    return clip_of_points(
        skeleton,
        times[later],
        frames[:, FROM_SDK, :3],
        None,
        format=FORMAT,
        reading=reading(
            units="m",
            units_rule="the format's",
            defects=repeated,
            notes=notes,
            columns=len(names),
        ),
        rotations=child_to_parent(frames[:, FROM_SDK, 3:], skeleton, Y_UP_TO_Z_UP),
    )


def _columns(names: list[str], source: Source, line: int) -> list[int]:
    """Indices of the count and of the 25 x 7 joint columns; CaptureError names those that are missing."""
    where = f"line {line}"
    index = {name: column for column, name in enumerate(names)}
    if len(index) != len(names):
        twice = next(name for column, name in enumerate(names) if index[name] != column)
        raise source.error(expected="column names once each", found=f"{twice[:40]!r} twice", where=where)
    wanted = [_CLOCK, *(f"joint{joint}{field}" for joint in range(len(SDK_JOINTS)) for field in _FIELDS)]
    missing = [name for name in wanted if name not in index]
    if missing:
        more = f" and {len(missing) - 3} more" if len(missing) > 3 else ""
        raise source.error(
            expected="a frame count, positions and orientations of 25 joints",
            found=f"no column {', '.join(missing[:3])}{more}",
            where=where,
        )
    return [index[name] for name in wanted]
