"""The known walk as a ZED's bodies: BODY_34, metres, Y up, nanoseconds."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.readers.landmarks.zed_json import POINTS
from samples.motion import in_sight, walk, y_up


def keypoints(joints: Array, size: int) -> Array:
    """(T, size, 3) in the axes of the joints (T, 20, 3); what no node needs is at the head."""
    points = np.repeat(joints[:, NODE_INDEX["head"]][:, None], size, axis=1)
    for node, number in POINTS[size].items():
        points[:, number] = joints[:, NODE_INDEX[node]]
    return points


def document(frames: int = 90, size: int = 34, *, down: bool = False) -> dict[str, Any]:
    """Frames by their times; nobody is seen in the third, two people in a third of them."""
    shown = in_sight(walk(frames))
    joints = y_up(shown.joints)
    if down:
        joints = joints * np.array([-1.0, -1.0, 1.0])
    points = keypoints(joints, size)
    found = {}
    for frame, time in enumerate(shown.times):
        stamp = 1_669_000_000_000_000_000 + round(1e9 * time)
        bodies = [] if frame == 2 else [(4, points[frame])]
        if frames // 3 <= frame < 2 * frames // 3:
            bodies.append((9, points[frame] + np.array([1.0, 0.0, 0.0])))
        found[str(stamp)] = {
            "timestamp": stamp,
            "is_tracked": True,
            "body_list": [
                {
                    "id": number,
                    "keypoint": [dict(zip("xyz", row, strict=True)) for row in place.round(7).tolist()],
                    "keypoint_confidence": [90.0] * (size - 1) + [20.0],
                }
                for number, place in bodies
            ],
        }
    return found


def files(frames: int = 90) -> dict[str, bytes]:
    """The document as text."""
    return {"bodies.json": json.dumps(document(frames), indent=1).encode()}
