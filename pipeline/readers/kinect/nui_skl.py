"""Kinect v1 recordings as `.skl` text: a header line, then one line per frame.

Columns (any of the four variants with 81, 85, 86 or 91, in any order; they are found by name): `timestamp` in
ms on the Kinect's clock, optionally framenum, adc and gyro columns, then per joint of the SDK `Name_X Name_Y
Name_Z Name_tracked`, optionally `FloorPlane_A..D`. Positions are metres, Y up, already relative to the floor:
FloorPlane describes the camera, and applying it again would be wrong. tracked: 0 not tracked, 1 inferred, 2
tracked.
"""

from __future__ import annotations

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.joint_names import REQUIRED
from kinemimic.pipeline.kinematics.skeleton import NODES, node_skeleton
from kinemimic.pipeline.readers.base.clip_building import clip_of_points, reading
from kinemimic.pipeline.readers.base.column_names import DESCRIBE
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.node_parents import skeleton_of
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.kinect.skl_text import (
    frames_of,
    header_of,
    is_kinect_v2,
    joint_columns,
    unread_columns,
)

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
_LEGS = frozenset(node.title().replace("_", "") for node in REQUIRED)


def recognises(source: Source) -> bool:
    """True if the first line is a header of columns of a Kinect v1's joints, and not of a Kinect v2's."""
    columns = joint_columns(source)
    return sum(name in _NAMES for name in columns) >= _MIN_COLUMNS and not is_kinect_v2(columns)


def read(source: Source) -> Clip:
    """The clip of the 20 nodes, or of those that have columns, one frame per line with a later time than
    before.

    Lines with a repeated or earlier time are dropped and counted. Raises CaptureError for legs without
    columns; arms, head and feet without are derived later (kinematics/nodes.py). Columns of other things are
    not read.
    """
    header = header_of(source)
    written = {joint.lower() for joint in header.joints}
    others = [joint for joint in header.joints if joint.lower() not in _NAMES]
    missing = [joint for joint in KINECT_V1_JOINTS if joint.lower() not in written]
    if needed := [joint for joint in missing if joint in _LEGS]:
        beside = f" beside {', '.join(others[:3])[:80]}" if others else ""
        raise source.error(
            expected="the joints of a Kinect v1, at least those of the legs",
            found=f"no columns of {', '.join(needed)}{beside}",
            line=header.line,
            advice=f"restore their names, {DESCRIBE}",
        )
    joints = tuple(joint for joint in KINECT_V1_JOINTS if joint not in missing)
    frames = frames_of(source, header, joints, sensor=FORMAT.sensor, usual_clocks=("ms",))
    notes = [*frames.notes, *unread_columns(others, FORMAT.sensor)]
    if missing:
        notes.append(f"no columns of {', '.join(missing)}")
    return clip_of_points(
        skeleton_of(tuple(NODES[KINECT_V1_JOINTS.index(joint)] for joint in joints))
        if missing
        else node_skeleton(),
        frames.times,
        frames.points,
        frames.states,
        format=FORMAT,
        reading=reading(
            units="m",
            units_rule="the format's",
            defects=frames.defects,
            notes=notes,
            columns=len(header.columns),
            **frames.facts,
        ),
    )
