"""The nodes of a clip are drawn where its camera sees them."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.video import video
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODES, TRACKED, node_skeleton
from kinemimic.pipeline.overlay.video_overlay import camera_of, draw_on_video

FRAMES, RATE = 6, 25.0
CAMERA = {"focal_px": 480.0, "height_m": 1.2, "pitch_rad": 0.05, "roll_rad": 0.0}
# A person who stands with the arms out, facing the camera: X, Y, Z of the right half in metres.
HEIGHTS = {"hip": (0.1, 0.9), "knee": (0.1, 0.48), "ankle": (0.1, 0.08), "foot": (0.12, 0.03)} | {
    "shoulder": (0.2, 1.4), "elbow": (0.45, 1.4), "wrist": (0.7, 1.4), "hand": (0.78, 1.4)
}  # fmt: skip
MIDDLE = {"hip_center": 0.92, "spine": 1.05, "shoulder_center": 1.42, "head": 1.62}


def clip_of(provenance: dict[str, object]) -> Clip:
    positions = np.zeros((FRAMES, len(NODES), 3))
    positions[..., 0] = 4.0
    for name, height in MIDDLE.items():
        positions[:, NODE_INDEX[name], 2] = height
    for name, (side, height) in HEIGHTS.items():
        positions[:, NODE_INDEX[f"{name}_left"], 1:] = (-side, height)
        positions[:, NODE_INDEX[f"{name}_right"], 1:] = (side, height)
    states = np.full(positions.shape[:2], TRACKED, dtype=np.uint8)
    passes = np.zeros(FRAMES, dtype=np.int32)
    times = np.arange(FRAMES) / RATE
    return Clip(node_skeleton(), times, positions, states, passes, provenance=provenance)


def test_joints_are_drawn_at_their_pixels(tmp_path: Path) -> None:
    path, out = tmp_path / "walk.webm", tmp_path / "overlay.webm"
    with video(path, 360, 640, RATE) as film:
        for _ in range(FRAMES):
            film.add(np.full((640, 360, 3), 90, dtype=np.uint8))
    clip = clip_of({"reading": {"camera": CAMERA, "image": [360, 640]}})
    assert draw_on_video(path, clip, out) == (FRAMES, FRAMES * len(NODES))
    capture = cv2.VideoCapture(str(out))
    image = capture.read()[1].astype(int)
    capture.release()
    green = (image[..., 1] > 150) & (image[..., 0] < 140) & (image[..., 2] < 140)
    rows, columns = np.nonzero(green)
    for node in ("head", "knee_left", "wrist_right", "ankle_right"):
        u, v = camera_of(clip).project(clip.positions[0, NODE_INDEX[node]])
        near = (np.abs(rows - v) < 5) & (np.abs(columns - u) < 5)
        assert near.sum() > 5, node
        assert (columns[near].mean(), rows[near].mean()) == pytest.approx((u, v), abs=1.5)


def test_a_clip_of_another_sensor_has_no_camera() -> None:
    with pytest.raises(KinemimicError, match="expected a clip of a video, with its camera, found BVH"):
        camera_of(clip_of({"format": "BVH", "reading": {}}))
