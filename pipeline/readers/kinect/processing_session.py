"""Sessions saved by a Processing sketch (KinectV2_SkeletonTools): a header, positions and orientations.

Separated by white space; columns are found by name: frameCount, about twelve features of the sketch (not
read), then joint0 to joint24 in the SDK's order, each with PositionX/Y/Z in metres in camera space and an
absolute OrientationW/X/Y/Z, w first. There is no time and there are no states. The sketch smoothed either
positions or orientations: a joint's +Y axis follows its bone within a few degrees at trunk and legs, but not
in fast arms.
"""

from __future__ import annotations

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import Y_UP_TO_Z_UP
from kinemimic.pipeline.readers.base.absolute_orientations import child_to_parent
from kinemimic.pipeline.readers.base.clip_building import clip_of_points, reading
from kinemimic.pipeline.readers.base.column_names import index_of_columns, require_columns
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
# Quaternions in our order: x, y, z, w.
_FIELDS = tuple(f"Position{axis}" for axis in "XYZ") + tuple(f"Orientation{part}" for part in "XYZW")


def recognises(source: Source) -> bool:
    """True if the first line is a header with the frame count and the joints' positions."""
    names = source.head[0].split()
    return _CLOCK in names and sum(name.startswith("joint") and "Position" in name for name in names) >= 20


def read(source: Source) -> Clip:
    """The clip of the 25 joints with rotations, one frame per complete line with a higher count."""
    names, line = source.head[0].split(), source.blank_lines + 1
    columns = _columns(names, source, line)
    table = parse_table(source, start=line, width=len(names), drop_other_widths=True)

    def where(row: int) -> str:
        return f"line {table.line(row)}"

    times = table.values[:, columns[0]] / RATE
    later, repeated = sensor_clock(times, where, source)
    frames = table.values[:, columns[1:]].reshape(len(times), len(SDK_JOINTS), len(_FIELDS))
    refuse_remote(frames[..., :3], SDK_JOINTS, source, table.where)
    check_quaternions(frames[..., 3:], SDK_JOINTS, where, source)
    frames = frames if later.all() else frames[later]
    notes = [f"no time in the file: the sketch's frame count at {RATE:g} frames per second"]
    if table.dropped:
        notes.append(f"{table.dropped} lines with more or fewer numbers than the header were dropped")
    skeleton = kinect_v2_skeleton()
    return clip_of_points(
        skeleton,
        times[later],
        frames[:, FROM_SDK, :3],
        None,
        format=FORMAT,
        reading=reading(
            units="m", units_rule="the format's", defects=repeated, notes=notes, columns=len(names)
        ),
        rotations=child_to_parent(frames[:, FROM_SDK, 3:], skeleton, Y_UP_TO_Z_UP),
    )


def _columns(names: list[str], source: Source, line: int) -> list[int]:
    """Indices of the frame count and of the 25 x 7 joint columns."""
    wanted = [_CLOCK, *(f"joint{joint}{field}" for joint in range(len(SDK_JOINTS)) for field in _FIELDS)]
    return require_columns(
        index_of_columns(names, source, line),
        wanted,
        source,
        line,
        expected="a frame count, positions and orientations of 25 joints",
    )
