"""Small videos of a drawn figure, with what OpenCV's writer cannot write: rotation flags, uneven clocks."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from pathlib import Path

import cv2
import numpy as np

from kinemimic.pipeline.files.video import quiet, without_stderr

WIDTH, HEIGHT, RATE = 96, 64, 25.0
# Codecs that OpenCV's wheel writes everywhere, by the ending of the file.
CODECS = {".mp4": "mp4v", ".avi": "MJPG", ".webm": "VP80"}
# The boxes of an MP4 that hold boxes.
_FOLDERS = (b"moov", b"trak", b"mdia", b"minf", b"stbl")


def figure(frame: int) -> np.ndarray:
    """An image (64, 96, 3) of a figure that walks right, red above and blue below."""
    image = np.full((HEIGHT, WIDTH, 3), 60, dtype=np.uint8)
    x, swing = 20 + 2 * frame, int(6 * np.sin(frame))
    cv2.circle(image, (x, 14), 5, (40, 40, 230), -1)
    cv2.line(image, (x, 18), (x, 38), (40, 40, 230), 4)
    for foot in (x - swing, x + swing):
        cv2.line(image, (x, 38), (foot, 58), (230, 60, 40), 4)
    return image


def film(path: Path, frames: int) -> Path:
    """A video of the figure, in the codec of the path's ending."""
    fourcc = cv2.VideoWriter.fourcc(*CODECS[path.suffix])
    # Quiet: OpenCV's first call decides for the whole process what FFmpeg may print.
    with quiet(), without_stderr():
        writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, fourcc, RATE, (WIDTH, HEIGHT))
        if not writer.isOpened():
            raise RuntimeError(f"no encoder for {path.suffix}")
        for k in range(frames):
            writer.write(figure(k))
        writer.release()
    return path


def turned(content: bytes, quarters: int) -> bytes:
    """An MP4 that is to be shown turned clockwise by quarters of a turn, as phones write."""
    a, b = round(np.cos(quarters * np.pi / 2)), round(np.sin(quarters * np.pi / 2))
    one = 1 << 16
    matrix = struct.pack(">9i", a * one, b * one, 0, -b * one, a * one, 0, 0, 0, 1 << 30)

    def change(header: bytes) -> bytes:
        return header[:40] + matrix + header[76:]

    return _changed(content, {b"tkhd": change})


def timed(content: bytes, seconds: Sequence[float]) -> bytes:
    """An MP4 whose frames last so many seconds each, to the tick of its clock."""
    scale = struct.unpack(">I", _box(content, b"mdhd")[12:16])[0]
    entries = b"".join(struct.pack(">II", 1, round(s * scale)) for s in seconds)
    table = struct.pack(">II", 0, len(seconds)) + entries
    # Without the edit list, which repeats the former duration.
    return _changed(content, {b"stts": lambda _: table, b"edts": lambda _: None})


def counted(content: bytes, frames: int) -> bytes:
    """An MP4 whose sample table claims so many frames of the same length."""

    def change(table: bytes) -> bytes:
        return table[:8] + struct.pack(">I", frames) + table[12:]

    return _changed(content, {b"stts": change})


def _changed(content: bytes, changes: dict[bytes, Callable[[bytes], bytes | None]]) -> bytes:
    """The boxes with some bodies changed; a change to None leaves the box out. The places of the frames stay
    true, because OpenCV writes the frames before the boxes."""
    out = b""
    for name, body in _boxes(content):
        inside = _changed(body, changes) if name in _FOLDERS else body
        new = changes[name](inside) if name in changes else inside
        if new is not None:
            out += struct.pack(">I", len(new) + 8) + name + new
    return out


def _boxes(content: bytes) -> list[tuple[bytes, bytes]]:
    found, at = [], 0
    while at < len(content):
        size = struct.unpack(">I", content[at : at + 4])[0]
        found.append((content[at + 4 : at + 8], content[at + 8 : at + size]))
        at += size
    return found


def _box(content: bytes, wanted: bytes) -> bytes:
    for name, body in _boxes(content):
        if name == wanted:
            return body
        if name in _FOLDERS and (inside := _box(body, wanted)):
            return inside
    return b""
