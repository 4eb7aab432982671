"""JSON of a Kinect v1's joints by name, of the people in each frame, as somebody's own program writes it."""

from __future__ import annotations

import json

from samples.joint_table import NAMES
from samples.motion import walk, y_up


def files(frames: int = 90) -> dict[str, bytes]:
    """Seconds and metres, Y up."""
    motion = walk(frames)
    content = [
        {
            "Timestamp": round(float(time), 6),
            "Bodies": [
                {
                    "TrackingId": 72057594037928037,
                    "Joints": [
                        {
                            "JointType": name,
                            "Position": dict(zip("XYZ", (round(float(x), 6) for x in place), strict=True)),
                            "TrackingState": 2,
                        }
                        for name, place in zip(NAMES, points, strict=True)
                    ],
                }
            ],
        }
        for time, points in zip(motion.times, y_up(motion.joints), strict=True)
    ]
    return {"joints.json": json.dumps({"Frames": content}, indent=1).encode()}
