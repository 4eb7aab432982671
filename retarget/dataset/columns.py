"""The columns of a data set: of its index, one row per capture, and of its shards, one row per frame."""

from __future__ import annotations

from collections.abc import Mapping

import pyarrow as pa

from kinemimic.pipeline.kinematics.angles import ANGLES
from kinemimic.pipeline.kinematics.skeleton import NODES

DATASET_SCHEMA = 1
INDEX, MOTIONS, SUMS, CARD = "index.parquet", "motions", "SHA256SUMS", "README.md"

_TEXT, _NUMBER, _COUNT, _LIST = pa.string(), pa.float64(), pa.int64(), pa.list_(pa.string())
# Column -> its type, and what it says.
INDEX_COLUMNS: Mapping[str, tuple[pa.DataType, str]] = {
    "name": (_TEXT, "the capture: its path, which is also that of its run folder"),
    "sha256": (_TEXT, "of the capture file; null for a folder"),
    "sidecar_files": (_LIST, "files beside it that were read with it"),
    "format": (_TEXT, "as in `kinemimic formats`"),
    "sensor": (_TEXT, "what recorded it"),
    "simulated": (pa.bool_(), "recorded by the virtual Kinect"),
    "subject": (_TEXT, "the person"),
    "split": (_TEXT, "train, validation or test; the same for all captures of a person"),
    "licence": (_TEXT, "of the capture, if it is known"),
    "frames": (_COUNT, "of the capture"),
    "rate_hz": (_NUMBER, "of the capture"),
    "passes": (_COUNT, "uninterrupted periods in which the person is in view"),
    "complete": (_NUMBER, "share of the frames in which all joints were seen"),
    "defects": (_LIST, "rules that found something, and what was done about it"),
    "status": (_TEXT, "accepted, refused, or failed (crash, time, memory)"),
    "stage": (_TEXT, "the stage that refused it"),
    "reason": (_TEXT, "why it was refused or failed"),
    "findings": (_LIST, "warnings about the motion"),
    "kind": (_TEXT, "walk, run or motion"),
    "cyclic": (pa.bool_(), "whether the motion is a loop"),
    "strides_used": (_NUMBER, "strides in the motion"),
    "strides_found": (_NUMBER, "strides in the capture"),
    "period_s": (_NUMBER, "duration of a stride"),
    "speed_m_s": (_NUMBER, "of the motion"),
    "path": (_TEXT, "where the path comes from"),
    "path_disagreement": (_NUMBER, "how far the sources of the path disagree"),
    "verdict": (_TEXT, "on the performance: good, fair, poor or falls"),
    "upright": (_NUMBER, "share of the frames before a fall, median of the start phases"),
    "knee_r2": (_NUMBER, "R² of the performed knees against the motion, no credit after a fall"),
    "hip_r2": (_NUMBER, "the same for the hips"),
    "knee_rmse_deg": (_NUMBER, "error of the performed knees"),
    "hip_rmse_deg": (_NUMBER, "the same for the hips"),
    "mpjpe_mm": (_NUMBER, "mean distance of the performed joints from the motion's"),
    "unperformed": (_TEXT, "why the tracker did not perform an accepted motion"),
    "motion": (_TEXT, "content hash of the motion; null without one"),
    "motion_frames": (_COUNT, "frames of the motion"),
    "motion_rate_hz": (_NUMBER, "its frames per second"),
    "cycle_offset_m": (pa.list_(pa.float64()), "how far one cycle of a loop advances: x, y, z"),
    "shard": (_TEXT, "the file that has the motion's frames"),
}

_SINGLES = pa.list_(pa.float32())
FRAME_COLUMNS: Mapping[str, tuple[pa.DataType, str]] = {
    "motion": (_TEXT, "`name` of the index"),
    "subject": (_TEXT, "the person"),
    "kind": (_TEXT, "walk, run or motion"),
    "frame": (pa.int32(), "from 0"),
    "time_s": (pa.float32(), "from the motion's first frame"),
    "root_m": (_SINGLES, "position of the hip centre: x forward, y left, z up"),
    "rotations_xyzw": (
        _SINGLES,
        f"unit quaternions of the {len(NODES)} nodes, child to parent, one after the other",
    ),
    "contact_left": (pa.bool_(), "whether the left foot is flat and still on the ground"),
    "contact_right": (pa.bool_(), "whether the right foot is flat and still on the ground"),
    **{f"{name}_deg": (pa.float32(), "flexion, 0 standing upright") for name in ANGLES},
}


def schema_of(columns: Mapping[str, tuple[pa.DataType, str]]) -> pa.Schema:
    """The columns without their descriptions."""
    return pa.schema([(name, kind) for name, (kind, _) in columns.items()])
