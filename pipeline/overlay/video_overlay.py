"""Draw the fitted skeleton into the images of a video, as the camera of the fit sees it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.body_fit.camera import SceneCamera
from kinemimic.pipeline.cli.progress import progress
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.video import video
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.overlay.draw import draw_caption, draw_skeleton
from kinemimic.pipeline.video.decode import Frame, frames

# Seconds; the clip keeps the video's own time stamps.
_TIME_TOLERANCE = 1e-5


def camera_of(clip: Clip) -> SceneCamera:
    """The camera of a clip that was read from a video; KinemimicError for another clip."""
    reading: dict[str, Any] = clip.provenance.get("reading", {})
    try:
        camera, (width, height) = reading["camera"], reading["image"]
        return SceneCamera(
            (int(width), int(height)),
            float(camera["focal_px"]),
            float(camera["height_m"]),
            float(camera["pitch_rad"]),
            float(camera["roll_rad"]),
        )
    except (KeyError, TypeError, ValueError):
        found = clip.provenance.get("format", "another capture")
        raise KinemimicError(f"expected a clip of a video, with its camera, found {found}") from None


def draw_on_video(path: Path, clip: Clip, out: Path) -> tuple[int, int]:
    """Write the video with the 20 nodes of its clip; the numbers of frames, and of joints drawn in them.

    Only one image is in memory at a time.
    """
    camera = camera_of(clip)
    positions, states = to_nodes(clip)
    pixels = camera.project(positions)
    rate = clip.rate or 30.0
    drawn = 0
    with (
        video(out, *camera.size, rate) as film,
        progress("overlay", len(clip.times), unit="frames") as bar,
    ):
        for frame in frames(path):
            now, state = _at(frame, clip, pixels, states)
            draw_skeleton(frame.image, now, state)
            draw_caption(frame.image, f"frame {frame.number}   {frame.time:.3f} s", state)
            film.add(frame.image)
            inside = (now >= 0.0).all(axis=-1) & (now < camera.size).all(axis=-1)
            drawn += int((inside & (state > 0)).sum())
            bar.advance()
        return film.frames, drawn


def _at(
    frame: Frame, clip: Clip, pixels: Array, states: NDArray[np.uint8]
) -> tuple[Array, NDArray[np.uint8]]:
    """Pixels (20, 2) and states (20,) in a frame; missing where the clip has none at its time."""
    row = min(int(np.searchsorted(clip.times, frame.time - _TIME_TOLERANCE)), len(clip.times) - 1)
    if abs(clip.times[row] - frame.time) > _TIME_TOLERANCE:
        return np.full((pixels.shape[1], 2), np.nan), np.zeros(pixels.shape[1], dtype=np.uint8)
    return pixels[row], states[row]
