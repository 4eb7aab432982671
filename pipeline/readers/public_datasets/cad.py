"""The skeletons of CAD-60 and CAD-120 (Cornell Activity Datasets): 15 joints of NiTE 1.3 on a Kinect v1.

J. Sung, C. Ponce, B. Selman, A. Saxena, "Unstructured Human Activity Detection from RGBD Images" (ICRA 2012);
H. S. Koppula, R. Gupta, A. Saxena, "Learning Human Activities and Object Affordances from RGB-D Videos" (IJRR
2013). A line per frame, its 171 numbers separated by commas: the frame's number; of 11 joints the orientation
(a matrix, row by row) with its confidence, and the position with its confidence; of hands and feet only the
position with its confidence. The last line is END. Millimetres, Y up, Z away from the sensor; confidences are
0 or 1. The orientations turn with the bones, which the positions show as well; they are not read.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import INFERRED, NODES, TRACKED
from kinemimic.pipeline.readers.base.clip_building import clip_of_points, reading
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import increasing_times, refuse_remote, zero_frames
from kinemimic.pipeline.readers.base.node_parents import skeleton_of
from kinemimic.pipeline.readers.base.numbers import Table, numbers_of, parse_table
from kinemimic.pipeline.readers.base.source import Source

# In the order of the files. NiTE's hands and feet are where a Kinect has wrists and ankles.
CAD_JOINTS: tuple[str, ...] = (
    "head", "shoulder_center", "spine", "shoulder_left", "elbow_left", "shoulder_right", "elbow_right",
    "hip_left", "knee_left", "hip_right", "knee_right", "wrist_left", "wrist_right", "ankle_left",
    "ankle_right",
)  # fmt: skip
_ORIENTED = 11
_ORIENTATION, _POSITION = 10, 4  # numbers, with the confidence
# Column of each joint's x, after which come y, z and the confidence; and of the orientations' confidences.
_FIRST = [
    1 + joint * _POSITION + min(joint + 1, _ORIENTED) * _ORIENTATION for joint in range(len(CAD_JOINTS))
]
_CONFIDENCES = [*(first + 3 for first in _FIRST), *(first - 1 for first in _FIRST[:_ORIENTED])]
WIDTH = _FIRST[-1] + _POSITION
FORMAT = Format(
    name="CAD-60 and CAD-120 skeletons",
    sensor="Kinect v1",
    holds="positions and confidences of 15 joints",
    recognised_by=f"lines of {WIDTH} numbers with commas: a frame number, orientations, positions, and "
    "confidences of 0 or 1",
    columns=(WIDTH,),
)
# Of the sensor, Hz: 45 s of an activity are 1,300 to 1,400 frames.
RATE = 30.0
_MOST_FRAMES = 216_000  # two hours
_END = "END"
_SKELETON = skeleton_of(tuple(node for node in NODES if node in CAD_JOINTS))
_FROM_FILE = [CAD_JOINTS.index(node) for node in _SKELETON.names]


def recognises(source: Source) -> bool:
    """True if the first line is a frame number, orientations, positions and confidences of 0 or 1."""
    numbers = numbers_of(source.head[0].rstrip().removesuffix(","), ",")
    if numbers is None or len(numbers) != WIDTH:
        return False
    return numbers[0] % 1.0 == 0.0 and all(numbers[column] in (0.0, 1.0) for column in _CONFIDENCES)


def read(source: Source) -> Clip:
    """The clip of 15 of the nodes; times are the frames' numbers at 30 Hz.

    A position of confidence 0 is inferred, one of zeros is missing. Raises CaptureError for a line of another
    width, a frame number that is no integer, and a confidence outside 0 to 1.
    """
    lines = ["" if line.strip(", ") == _END else line for line in source.lines]
    table = parse_table(source.with_text("\n".join(lines)), width=WIDTH, separator=",")
    numbers = table.values[:, 0]
    joints = table.values[:, np.add.outer(_FIRST, np.arange(_POSITION))]
    points, sure = 0.001 * joints[..., :3], joints[..., 3]
    whole = (np.abs(numbers) < _MOST_FRAMES) & (numbers % 1.0 == 0.0)
    _require(whole, numbers, "a frame number", table, source)
    _require((sure >= 0.0) & (sure <= 1.0), sure, "a confidence from 0 to 1", table, source)
    refuse_remote(points, CAD_JOINTS, source, table.where, unit="mm")
    later, defects = increasing_times(numbers)
    points, sure = points[later][:, _FROM_FILE], sure[later][:, _FROM_FILE]
    return clip_of_points(
        _SKELETON,
        numbers[later] / RATE,
        points,
        np.where(sure == 1.0, TRACKED, INFERRED).astype(np.uint8),
        format=FORMAT,
        reading=reading(
            units="mm",
            units_rule="the format's",
            defects=[*defects, *zero_frames(points)],
            notes=[f"times are frame numbers at {RATE:g} Hz, the sensor's rate"],
        ),
    )


def _require(right: Mask, values: Array, expected: str, table: Table, source: Source) -> None:
    """Raise CaptureError for the first value that is not right; both (T, ...), a row of the table each."""
    if not right.all():
        place = tuple(np.argwhere(~right)[0])
        raise source.error(expected=expected, found=f"{values[place]:g}", line=table.line(place[0]))
