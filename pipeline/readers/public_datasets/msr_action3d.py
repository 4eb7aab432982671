"""MSR-Action3D in world coordinates: x y z confidence per line, 20 lines per frame, 15 Hz.

The order of the joints is the data set's own. A model was fitted to the image, so every joint has a position;
the confidence (0 to 1) states how much of it was seen: spine, neck and feet have 0 in nearly all frames and
are as steady as the others, but wrists below 1 jump two to four times as far. Hence 0.5 and above is tracked,
below is inferred, and only a position of zeros is missing. Metres, Y up. The data set's other form, in
pixels, is refused.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import INFERRED, NODE_INDEX, NODES, TRACKED, node_skeleton
from kinemimic.pipeline.quality.rules.length_units import LEG_RANGE
from kinemimic.pipeline.readers.base.body_posture import is_upright_body
from kinemimic.pipeline.readers.base.clip_building import clip_of_points, reading
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import zero_frames
from kinemimic.pipeline.readers.base.numbers import Table, numbers_of, parse_table
from kinemimic.pipeline.readers.base.source import Source

FORMAT = Format(
    name="MSR-Action3D lines",
    sensor="depth camera like a Kinect v1",
    holds="positions and confidence of 20 joints",
    recognised_by="lines of 4 numbers, the last from 0 to 1; 20 lines form an upright body",
    columns=(4,),
)
RATE = 15.0
MSR_JOINTS: tuple[str, ...] = (
    "shoulder_left", "shoulder_right", "shoulder_center", "spine", "hip_left", "hip_right", "hip_center",
    "elbow_left", "elbow_right", "wrist_left", "wrist_right", "hand_left", "hand_right", "knee_left",
    "knee_right", "ankle_left", "ankle_right", "foot_left", "foot_right", "head",
)  # fmt: skip
# positions_of_nodes = positions_of_the_file[:, FROM_FILE]
FROM_FILE: tuple[int, ...] = tuple(MSR_JOINTS.index(node) for node in NODES)
_TRACKED_FROM = 0.5
# In metres; depth cameras of that time have no larger range.
_MAX_COORDINATE = 20.0


def recognises(source: Source) -> bool:
    """True if the lines are four numbers, the last a confidence, and whole frames of 20 are a body."""
    rows: list[list[float]] = []
    for line in source.head:
        row = numbers_of(line, None)
        if row is None or len(row) != 4:
            break
        rows.append(row)
    frames = len(rows) // len(MSR_JOINTS)
    # Other lines may be damage further down, but not in the first frame.
    if not frames or (len(rows) < len(source.head) - 1 and frames < 2):
        return False
    table = np.array(rows[: frames * len(MSR_JOINTS)]).reshape(frames, len(MSR_JOINTS), 4)
    if not ((table[..., 3] >= 0) & (table[..., 3] <= 1)).all():
        return False
    seen = table[table[..., :3].any(axis=(1, 2))]
    return is_upright_body(seen[:, FROM_FILE, :3])


def read(source: Source) -> Clip:
    """The clip of the 20 nodes at the nominal 15 Hz.

    Raises CaptureError for a frame of fewer than 20 lines, a confidence outside 0 to 1, and for pixels.
    """
    table = parse_table(source, width=4)
    rows = len(table.values)
    if rows % len(MSR_JOINTS):
        raise source.error(
            expected=f"{len(MSR_JOINTS)} lines per frame",
            found=f"{rows % len(MSR_JOINTS)} in the last one",
            line=table.line(rows - 1),
            advice="the file is cut off there, or a line is missing",
        )
    confidence = table.values[:, 3]
    wrong = ~((confidence >= 0.0) & (confidence <= 1.0))
    if wrong.any():
        row = int(np.argmax(wrong))
        raise source.error(
            expected="a confidence from 0 to 1", found=f"{confidence[row]:g}", line=table.line(row)
        )
    frames = table.values.reshape(-1, len(MSR_JOINTS), 4)[:, FROM_FILE]
    points = np.where(np.isfinite(frames[..., :3]), frames[..., :3], np.nan)
    _refuse_pixels(points, table, source)
    return clip_of_points(
        node_skeleton(),
        np.arange(len(points)) / RATE,
        points,
        np.where(frames[..., 3] >= _TRACKED_FROM, TRACKED, INFERRED).astype(np.uint8),
        format=FORMAT,
        reading=reading(
            units="m",
            units_rule="the format's",
            defects=zero_frames(points),
            notes=[f"the file has no clock: {RATE:g} Hz, the data set's nominal rate"],
        ),
    )


def _refuse_pixels(points: Array, table: Table, source: Source) -> None:
    """Raise CaptureError unless coordinates and legs are a person's in metres."""
    advice = "these may be image coordinates: use the data set's real-world form"
    remote = np.abs(points) > _MAX_COORDINATE
    if remote.any():
        frame, node, axis = (int(k) for k in np.argwhere(remote)[0])
        raise source.error(
            expected=f"metres, at most {_MAX_COORDINATE:g}, in the {NODES[node]}",
            found=f"{points[frame, node, axis]:g}",
            line=table.line(frame * len(MSR_JOINTS) + FROM_FILE[node]),
            advice=advice,
        )
    hip, knee, ankle = (points[:, NODE_INDEX[f"{joint}_left"]] for joint in ("hip", "knee", "ankle"))
    legs = np.linalg.norm(knee - hip, axis=-1) + np.linalg.norm(ankle - knee, axis=-1)
    legs = legs[np.isfinite(legs) & (legs > 0)]
    if len(legs) and not LEG_RANGE[0] <= np.median(legs) <= LEG_RANGE[1]:
        raise source.error(
            expected=f"thigh and shank of {LEG_RANGE[0]} to {LEG_RANGE[1]} m",
            found=f"{np.median(legs):.3g}",
            advice=advice,
        )
