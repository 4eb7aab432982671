"""A video file, written whole or not at all."""

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

# What the headless wheel of OpenCV can write and read back; its H.264 needs a device of its own.
CODECS: dict[str, str] = {".mp4": "mp4v", ".avi": "MJPG"}
_FFMPEG_LOG = "OPENCV_FFMPEG_LOGLEVEL"
# MPEG-4 counts time in 1/65535 s at the finest, and OpenCV asks for decimals of the rate: 66.667 would be too
# many.
_MOST_TICKS = 65535
_SLOWEST = 0.01  # frames a second


class Video:
    """What `video` hands out: add one image (H, W, 3), blue, green, red, after the other."""

    def __init__(self, writer: cv2.VideoWriter, width: int, height: int) -> None:
        self._writer, self._width, self._height = writer, width, height
        self.frames = 0

    def add(self, image: Image) -> None:
        """Append a frame of the size that the video was opened with."""
        below, right = self._height - image.shape[0], self._width - image.shape[1]
        if below or right:
            image = np.pad(image, ((0, below), (0, right), (0, 0)))
        self._writer.write(np.ascontiguousarray(image))
        self.frames += 1


@contextmanager
def video(path: Path, width: int, height: int, rate: float) -> Iterator[Video]:
    """A video of `rate` frames a second at `path` (.mp4 or .avi), there only once the block has ended well.

    Codecs halve the colours' resolution: an odd width or height gets a black margin of one pixel. The rate is
    rounded to as many decimals as they take (66.67), and is 0.01 at least.
    KinemimicError if the codec does not open, or the file does not hold every frame (a full disk).
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
                raise KinemimicError(f"{path}: expected to write {codec} video, found no encoder for it here")
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
    """The nearest rate that every codec can name."""
    digits = next((n for n in (3, 2, 1) if rate * 10**n <= _MOST_TICKS), 0)
    return max(round(rate, digits), _SLOWEST)


@contextmanager
def _quiet() -> Iterator[None]:
    """OpenCV's own words about frames that it could not write kept off the terminal: ours say it once."""
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
    """How many frames a video file says it has; 0 for none that opens."""
    capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    try:
        return int(capture.get(cv2.CAP_PROP_FRAME_COUNT)) if capture.isOpened() else 0
    finally:
        capture.release()
