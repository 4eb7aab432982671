"""Video of a rerun recording, rendered frame by frame without a screen."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pyarrow.compute as pc
from rerun.chunk import RrdReader

from kinemimic.evaluate.view.headless import headless_viewer
from kinemimic.pipeline.cli.progress import progress
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.overlay.video import video

SIZE = (1280, 800)


def record_video(recording: Path, path: Path, *, timeline: str, rate: float, seconds: float) -> None:
    """Render the first seconds of a recording (all of it if it is shorter) to a video (.mp4 or .avi).

    Frame f shows (f + 1) / rate seconds of the timeline. Requirements: see `headless_viewer`. No file is left
    behind after an error.
    """
    frames = max(1, round(min(seconds, duration(recording, timeline)) * rate))
    with (
        video(path, *SIZE, rate) as written,
        headless_viewer(recording, timeline=timeline, size=SIZE, latest=frames / rate) as draw,
        progress("video", frames) as bar,
    ):
        for frame in range(frames):
            image = cv2.imdecode(np.frombuffer(draw((frame + 1) / rate), np.uint8), cv2.IMREAD_COLOR)
            if image is None:
                raise KinemimicError(
                    f"{path}: expected an image of frame {frame} from the viewer, found none"
                )
            written.add(np.asarray(image, dtype=np.uint8))
            bar.advance()


def duration(recording: Path, timeline: str) -> float:
    """Time in seconds of the last event on a recording's timeline; 0.0 if there is none."""
    latest = 0
    for chunk in RrdReader(recording).store().stream():
        batch = chunk.to_record_batch()
        if timeline in batch.schema.names:
            latest = max(latest, pc.max(batch[timeline].cast("int64")).as_py())
    return latest * 1e-9
