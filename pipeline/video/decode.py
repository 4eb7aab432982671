"""Decode a video: upright images with true time stamps, one at a time."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.files.video import quiet

Image = NDArray[np.uint8]
"""An image (H, W, 3) of blue, green and red."""

# Four hours at 60 Hz, and twice the sides of an 8K video: other files are not of a person who moves.
MAX_FRAMES = 864_000
MAX_SIDE = 16_384


@dataclass(frozen=True)
class Frame:
    """A decoded frame: its number from 0, its time in seconds from the first frame, and the image."""

    number: int
    time: float
    image: Image


def frames(path: Path, *, skip: int = 0) -> Iterator[Frame]:
    """Every frame of a video after the first `skip`; images are turned upright as the container says.

    Time stamps are the container's own, so that a variable rate stays true; a stamp that does not increase
    (some recorders write none for the last frames) is replaced by one step of the rate so far. Only one image
    is in memory at a time. Raises CaptureError for a file that does not decode, and for one of more than
    MAX_FRAMES frames.
    """
    with _opened(path) as capture:
        for number, time in _stamps(path, capture):
            if number >= skip:
                decoded, image = capture.retrieve()
                if not decoded:
                    break
                yield Frame(number, time, np.asarray(image, dtype=np.uint8))


def frame_times(path: Path) -> Array:
    """Times (T,) of all frames, s from the first one, as `frames` has them; no image is converted."""
    with _opened(path) as capture:
        return np.array([time for _, time in _stamps(path, capture)])


def _stamps(path: Path, capture: cv2.VideoCapture) -> Iterator[tuple[int, float]]:
    """Number and time, s, of every frame that is grabbed."""
    number, first, before, step = 0, 0.0, -np.inf, _nominal_step(capture)
    while capture.grab():
        if number >= MAX_FRAMES:
            raise CaptureError(path, expected=f"a video of at most {MAX_FRAMES:,} frames", found="more")
        stamp = float(capture.get(cv2.CAP_PROP_POS_MSEC)) * 1e-3
        first = stamp if number == 0 else first
        time = stamp - first
        if not time > before:
            time = before + step
        elif number:
            step = time - before
        yield number, time
        number, before = number + 1, time
    if number == 0:
        raise CaptureError(path, expected="a video with frames", found="none that decodes")


@contextmanager
def _opened(path: Path) -> Iterator[cv2.VideoCapture]:
    """An open video of a size that images can have."""
    with quiet():
        capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
        try:
            if not capture.isOpened():
                raise CaptureError(
                    path, expected="a video that FFmpeg decodes", found="a damaged or other file"
                )
            width, height = (
                capture.get(one) for one in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT)
            )
            if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE):
                expected = f"images of 1 to {MAX_SIDE} pixels a side"
                raise CaptureError(path, expected=expected, found=f"{width:.0f}x{height:.0f}")
            capture.set(cv2.CAP_PROP_ORIENTATION_AUTO, 1)
            yield capture
        finally:
            capture.release()


def expected_frames(path: Path) -> float:
    """Number of frames that the container states, for progress only: it can be wrong. math.inf for none."""
    with _opened(path) as capture:
        count = float(capture.get(cv2.CAP_PROP_FRAME_COUNT))
    return count if 1.0 <= count <= MAX_FRAMES else math.inf


def _nominal_step(capture: cv2.VideoCapture) -> float:
    rate = float(capture.get(cv2.CAP_PROP_FPS))
    return 1.0 / rate if np.isfinite(rate) and rate > 0.0 else 1.0 / 30.0
