"""Write a video file atomically."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import atomic
from kinemimic.pipeline.readers.depth.frames import Image

# Codecs that the headless OpenCV wheel can write and read; its H.264 encoder needs a hardware device.
CODECS: dict[str, str] = {".mp4": "mp4v", ".avi": "MJPG"}
_FFMPEG_LOG = "OPENCV_FFMPEG_LOGLEVEL"
# MPEG-4 has at most 65535 ticks per second, and OpenCV needs a tick per decimal of the rate: 66.667 Hz would
# need too many.
_MAX_TICKS = 65535
_MIN_RATE = 0.01  # Hz


class Video:
    """An open video file, returned by `video`."""

    def __init__(self, writer: cv2.VideoWriter, width: int, height: int) -> None:
        self._writer, self._width, self._height = writer, width, height
        self.frames = 0

    def add(self, image: Image) -> None:
        """Append an image (H, W, 3) in blue, green, red, of the size of the video."""
        below, right = self._height - image.shape[0], self._width - image.shape[1]
        if below or right:
            image = np.pad(image, ((0, below), (0, right), (0, 0)))
        self._writer.write(np.ascontiguousarray(image))
        self.frames += 1


@contextmanager
def video(path: Path, width: int, height: int, rate: float) -> Iterator[Video]:
    """A video at `rate` Hz in `path` (.mp4 or .avi), written only if the block succeeds.

    An odd width or height is padded with a black pixel, since codecs halve the resolution of colours. The
    rate is rounded to the decimals that the codec can represent (66.67), and at least 0.01 Hz.
    KinemimicError if the codec does not open, or if frames are missing in the file (full disk).
    """
    codec = CODECS.get(path.suffix.lower())
    if codec is None:
        raise KinemimicError(f"{path}: expected a video named {' or '.join(CODECS)}, found {path.suffix!r}")
    width, height = width + width % 2, height + height % 2
    with atomic(path) as temporary, _quiet():
        fourcc = cv2.VideoWriter.fourcc(*codec)
        writer = cv2.VideoWriter(str(temporary), cv2.CAP_FFMPEG, fourcc, _rate(rate), (width, height))
        try:
            if not writer.isOpened():
                raise KinemimicError(f"{path}: expected an encoder for {codec} video, found none")
            written = Video(writer, width, height)
            yield written
        finally:
            writer.release()
        found = _frames(temporary)
        if found != written.frames:
            raise KinemimicError(
                f"{path}: expected a video of {written.frames} frames, found {found} in it; is the disk full?"
            )


def _rate(rate: float) -> float:
    """The nearest rate that every codec can represent."""
    digits = next((n for n in (3, 2, 1) if rate * 10**n <= _MAX_TICKS), 0)
    return max(round(rate, digits), _MIN_RATE)


@contextmanager
def _quiet() -> Iterator[None]:
    """Silence OpenCV's messages about unwritten frames; `video` reports them once."""
    level = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    before = os.environ.get(_FFMPEG_LOG)
    os.environ[_FFMPEG_LOG] = "-8"  # AV_LOG_QUIET
    try:
        yield
    finally:
        cv2.utils.logging.setLogLevel(level)
        if before is None:
            del os.environ[_FFMPEG_LOG]
        else:
            os.environ[_FFMPEG_LOG] = before


def _frames(path: Path) -> int:
    """Number of frames in a video file; 0 if it does not open."""
    capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    try:
        return int(capture.get(cv2.CAP_PROP_FRAME_COUNT)) if capture.isOpened() else 0
    finally:
        capture.release()
