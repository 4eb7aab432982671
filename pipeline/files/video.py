"""Write a video file that browsers play, atomically."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import atomic

# Encoders to try, in this order. VP8 before VP9: at OpenCV's settings its files are as large and as exact,
# and are written four times as fast. No browser plays MPEG-4 part 2, which OpenCV writes everywhere.
CODECS: dict[str, tuple[str, ...]] = {".webm": ("VP80", "VP90"), ".mp4": ("avc1",)}
_NAMES = {".webm": "VP8 or VP9", ".mp4": "H.264"}
_FFMPEG_LOG = "OPENCV_FFMPEG_LOGLEVEL"
# OpenCV needs a tick per decimal of the rate, and there are at most 65535 per second: 66.667 Hz would need
# too many.
_MAX_TICKS = 65535
_MIN_RATE = 0.1  # Hz; VP8 refuses slower ones


class Video:
    """An open video file, returned by `video`."""

    def __init__(self, writer: cv2.VideoWriter, width: int, height: int) -> None:
        self._writer, self._width, self._height = writer, width, height
        self.frames = 0

    def add(self, image: NDArray[np.uint8]) -> None:
        """Append an image (H, W, 3) in blue, green, red, of the size of the video."""
        below, right = self._height - image.shape[0], self._width - image.shape[1]
        if below or right:
            image = np.pad(image, ((0, below), (0, right), (0, 0)))
        self._writer.write(np.ascontiguousarray(image))
        self.frames += 1


def require_encoder(path: Path) -> None:
    """KinemimicError unless `video` can write this file; to be called before long work."""
    with tempfile.TemporaryDirectory() as folder, quiet():
        _opened(path, Path(folder) / path.name, 30.0, (64, 64)).release()


@contextmanager
def video(path: Path, width: int, height: int, rate: float) -> Iterator[Video]:
    """A video at `rate` Hz in `path` (.webm; .mp4 where there is an H.264 encoder), written only if the block
    succeeds.

    An odd width or height is padded with a black pixel, since codecs halve the resolution of colours. The
    rate is rounded to the decimals that the codec can represent (66.67), and at least 0.1 Hz.
    KinemimicError for another ending or without an encoder, or if frames are missing in the file (full disk).
    """
    width, height = width + width % 2, height + height % 2
    with atomic(path) as temporary, quiet():
        writer = _opened(path, temporary, _rate(rate), (width, height))
        try:
            written = Video(writer, width, height)
            yield written
        finally:
            writer.release()
        found = _frames(temporary)
        if found != written.frames:
            raise KinemimicError(
                f"{path}: expected a video of {written.frames} frames, found {found} in it; is the disk full?"
            )


def _opened(path: Path, temporary: Path, rate: float, size: tuple[int, int]) -> cv2.VideoWriter:
    """The first encoder for `path` that opens, writing to `temporary`; a KinemimicError if there is none."""
    suffix = path.suffix.lower()
    if suffix not in CODECS:
        raise KinemimicError(f"{path}: expected a video named {' or '.join(CODECS)}, found {path.suffix!r}")
    for codec in CODECS[suffix]:
        with without_stderr():
            fourcc = cv2.VideoWriter.fourcc(*codec)
            writer = cv2.VideoWriter(str(temporary), cv2.CAP_FFMPEG, fourcc, rate, size)
        if writer.isOpened():
            return writer
        writer.release()
    advice = "" if suffix == ".webm" else "; name it *.webm, which browsers play too"
    raise KinemimicError(f"{path}: expected an encoder for {_NAMES[suffix]}, found none{advice}")


def _rate(rate: float) -> float:
    """The nearest rate that every codec can represent."""
    digits = next((n for n in (3, 2, 1) if rate * 10**n <= _MAX_TICKS), 0)
    return max(round(rate, digits), _MIN_RATE)


@contextmanager
def without_stderr() -> Iterator[None]:
    """Silence what libraries write to stderr: OpenCV remarks on every WebM, and on encoders that it fails
    to find, whatever its settings."""
    kept = os.dup(2)
    try:
        with Path(os.devnull).open("wb") as nowhere:
            os.dup2(nowhere.fileno(), 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)


@contextmanager
def quiet() -> Iterator[None]:
    """Silence OpenCV's messages about frames that it cannot write or decode; the caller reports them once."""
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
    """Number of frames that a video file holds; 0 if it does not open."""
    capture, count = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG), 0
    try:
        # Counted, because the header of a WebM states a length only.
        while capture.grab():
            count += 1
        return count
    finally:
        capture.release()
