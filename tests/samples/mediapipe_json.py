"""MediaPipe's landmarks of the known walk as JSON: image and world landmarks of each frame."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from kinemimic.pipeline.arrays import Array
from samples.mediapipe_csv import visibility, world_landmarks
from samples.motion import walk


def image_landmarks(world: Array) -> Array:
    """Shares of a picture of 1280 x 720 pixels, seen from 4 m by a lens of 1000 pixels."""
    depth = world[..., 2:] + 4.0
    flat = 1000.0 * world[..., :2] / depth / np.array([1280.0, 720.0]) + 0.5
    return np.concatenate([flat, world[..., 2:] / 2.0], axis=-1)


def document(frames: int = 90) -> list[dict[str, Any]]:
    """A frame each 33 ms; nobody is seen in the third."""
    shown = walk(frames)
    world, seen = world_landmarks(shown), visibility(frames)

    def landmarks(points: Array, levels: Array) -> list[dict[str, float]]:
        rows = np.column_stack([points, levels]).round(9)
        return [dict(zip(("x", "y", "z", "visibility"), row, strict=True)) for row in rows.tolist()]

    image = image_landmarks(world)
    return [
        {
            "timestamp_ms": round(1000.0 * time, 3),
            "pose_landmarks": [] if frame == 2 else [landmarks(image[frame], seen[frame])],
            "pose_world_landmarks": [] if frame == 2 else [landmarks(world[frame], seen[frame])],
        }
        for frame, time in enumerate(shown.times)
    ]


def files(frames: int = 90) -> dict[str, bytes]:
    """The document as text."""
    return {"pose.json": json.dumps(document(frames), indent=1).encode()}
