"""The body of a FreeMoCap recording on the known walk: 33 landmarks, mm, Z up."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.readers.landmarks.blaze_pose import LANDMARKS
from samples.mediapipe_csv import world_landmarks
from samples.motion import Walk, in_sight, walk


def table(shown: Walk, prefix: str = "body_") -> bytes:
    """The table; prefix: of the columns."""
    hips = 0.5 * (shown.joints[:, 12] + shown.joints[:, 16])
    seen = world_landmarks(shown)
    points = 1000.0 * (np.stack([seen[..., 2], -seen[..., 0], -seen[..., 1]], axis=-1) + hips[:, None])
    names = [f"{prefix}{landmark}_{axis}" for landmark in LANDMARKS for axis in "xyz"]
    lines = [
        ",".join(names),
        *(",".join(f"{value:.6f}" for value in row) for row in points.reshape(len(points), -1)),
    ]
    return ("\n".join(lines) + "\n").encode()


def files(frames: int = 90) -> dict[str, bytes]:
    """The table alone."""
    return {"body_3d_xyz.csv": table(in_sight(walk(frames)))}
