"""Kinect v1 recordings as `.skl` text: a header line, then one line per frame.

Columns (any of the four variants with 81, 85, 86 or 91, in any order; they are found by name): `timestamp` in
ms on the Kinect's clock, optionally framenum, adc and gyro columns, then per joint of the SDK `Name_X Name_Y
Name_Z Name_tracked`, optionally `FloorPlane_A..D`. Positions are metres, Y up, already relative to the floor:
FloorPlane describes the camera, and applying it again would be wrong. tracked: 0 not tracked, 1 inferred, 2
tracked.
"""

from __future__ import annotations

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODES, node_skeleton
from kinemimic.pipeline.readers.base.clip_building import clip_of_points, reading
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.kinect.skl_text import frames_of, header_of, is_kinect_v2, joint_columns

FORMAT = Format(
    name="Kinect v1 .skl text",
    sensor="Kinect v1",
    holds="positions and states of 20 joints",
    recognised_by="a header of columns Name_X Name_Y Name_Z Name_tracked",
    columns=(81, 85, 86, 91),
)
# "hip_center" is HipCenter in the file.
KINECT_V1_JOINTS: tuple[str, ...] = tuple(node.title().replace("_", "") for node in NODES)
# A header with this many joint columns is of this format, even if some columns are missing.
_MIN_COLUMNS = 20
_NAMES = frozenset(joint.lower() for joint in KINECT_V1_JOINTS)


def recognises(source: Source) -> bool:
    """True if the first line is a header of columns of a Kinect v1's joints, and not of a Kinect v2's."""
    columns = joint_columns(source)
    return sum(name in _NAMES for name in columns) >= _MIN_COLUMNS and not is_kinect_v2(columns)


def read(source: Source) -> Clip:
    """The clip of the 20 nodes, one frame per line with a later time than before.

    Lines with a repeated or earlier time are dropped and counted.
    """
    header = header_of(source)
    unknown = sorted({joint.lower() for joint in header.joints} - _NAMES)
    if unknown:
        raise source.error(
            expected="the 20 joints of a Kinect v1",
            found=f"{len(header.joints)} joints, including {', '.join(unknown[:3])[:80]}",
            line=header.line,
        )
    frames = frames_of(source, header, KINECT_V1_JOINTS, sensor=FORMAT.sensor, usual_clocks=("ms",))
    return clip_of_points(
        node_skeleton(),
        frames.times,
        frames.points,
        frames.states,
        format=FORMAT,
        reading=reading(
            units="m",
            units_rule="the format's",
            defects=frames.defects,
            notes=frames.notes,
            columns=len(header.columns),
            **frames.facts,
        ),
    )
