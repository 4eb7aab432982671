"""JSON of Human3.6M's 17 joints without names, of the people in each frame, as MMPose writes it."""

from __future__ import annotations

import json

from kinemimic.pipeline.readers.landmarks.joint_sets import SETS
from samples.joint_array import joints
from samples.motion import walk


def files(frames: int = 90) -> dict[str, bytes]:
    """Metres, in a camera's axes, with a score of each joint."""
    content = [
        {
            "frame_id": number,
            "instances": [{"keypoints": places.round(6).tolist(), "keypoint_scores": [0.9] * len(places)}],
        }
        for number, places in enumerate(joints(walk(frames), SETS[0]))
    ]
    return {"lists.json": json.dumps(content, indent=1).encode()}
