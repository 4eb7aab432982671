"""The known walk as EasyMocap writes an SMPL body, and as arrays by other names in JSON."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import from_rotvec, rotate
from kinemimic.pipeline.readers.segments.smpl_clip import JOINTS
from samples.amass import poses
from samples.motion import rigid_walk

RATE = 30.0
# The pelvis of the mean SMPL body in the model's axes, as public code states it, metres.
PELVIS = np.array([-0.0018, -0.2233, 0.0282])


def walk(frames: int) -> tuple[Array, Array]:
    """Axis-angle vectors (T, 24, 3) of an SMPL body, and the pelvis' path (T, 3)."""
    shown = rigid_walk(frames, RATE)
    turned = np.zeros((frames, 24, 3))
    turned[:, : len(JOINTS)] = poses(shown)
    return turned, shown.root


def people(frames: int) -> list[dict[str, Any]]:
    """EasyMocap's parameters of each frame."""
    turned, path = walk(frames)
    # The body turns about the model's origin, not about the pelvis.
    moved = path - rotate(from_rotvec(turned[:, 0]), np.broadcast_to(PELVIS, path.shape))
    return [
        {
            "id": 0,
            "Rh": [turned[frame, 0].round(6).tolist()],
            "Th": [moved[frame].round(6).tolist()],
            "poses": [[0.0] * 3 + turned[frame, 1:].ravel().round(6).tolist()],
            "shapes": [[0.0] * 10],
        }
        for frame in range(frames)
    ]


def files(frames: int = 90) -> dict[str, bytes]:
    content = [{"frame": number, "annots": [one]} for number, one in enumerate(people(frames))]
    return {"walk.json": json.dumps(content, indent=1).encode()}
