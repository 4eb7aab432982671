"""A film of a rerun recording, made without a screen: what the viewer shows, frame by frame."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from kinemimic.evaluate.headless import drawing
from kinemimic.pipeline.depth.video import video
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.progress import progress

SIZE = (1280, 800)


def film(recording: Path, path: Path, *, timeline: str, rate: float, frames: int) -> None:
    """Draw the first frames of a recording into a video (.mp4 or .avi) in real time.

    Frame f is drawn at (f + 1) / rate seconds of the timeline. Needs what `headless.drawing` does; nothing is
    left behind where it ends early.
    """
    with (
        video(path, *SIZE, rate) as written,
        drawing(recording, timeline=timeline, size=SIZE, last=frames / rate) as draw,
        progress("film", frames) as bar,
    ):
        for frame in range(frames):
            image = cv2.imdecode(np.frombuffer(draw((frame + 1) / rate), np.uint8), cv2.IMREAD_COLOR)
            if image is None:
                raise KinemimicError(f"{path}: expected the viewer's picture of frame {frame}, found none")
            written.add(np.asarray(image, dtype=np.uint8))
            bar.advance()
