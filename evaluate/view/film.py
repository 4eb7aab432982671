"""A film of a rerun recording, made without a screen: what the viewer shows, frame by frame."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pyarrow.compute as pc
from rerun.chunk import RrdReader

from kinemimic.evaluate.view.headless import drawing
from kinemimic.pipeline.cli.progress import progress
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.overlay.video import video

SIZE = (1280, 800)


def film(recording: Path, path: Path, *, timeline: str, rate: float, seconds: float) -> None:
    """Draw the first seconds of a recording, all of it if it has no more, into a video (.mp4 or .avi).

    Frame f is drawn at (f + 1) / rate seconds of the timeline. Needs what `headless.drawing` does; nothing is
    left behind where it ends early.
    """
    frames = max(1, round(min(seconds, length(recording, timeline)) * rate))
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


def length(recording: Path, timeline: str) -> float:
    """Seconds of a recording's timeline at which something happens last; 0.0 where nothing does."""
    latest = 0
    for chunk in RrdReader(recording).store().stream():
        batch = chunk.to_record_batch()
        if timeline in batch.schema.names:
            latest = max(latest, pc.max(batch[timeline].cast("int64")).as_py())
    return latest * 1e-9
