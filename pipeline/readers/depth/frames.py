"""Depth and colour images, read within bounds: what a header announces is checked before it is unpacked."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.readers.depth.camera import Camera

Depth = NDArray[np.float32]
Image = NDArray[np.uint8]

# Beside the pixels themselves; a PNG of noise is a little larger than they are.
_OVERHEAD = 2**20
_PNG = b"\x89PNG\r\n\x1a\n"
_JPEG = b"\xff\xd8"
_JPEG_END = b"\xff\xd9"
# Frame headers of JPEG (SOF0 to SOF15 without DHT, JPG, DAC) hold the size (ITU T.81, table B.1).
_JPEG_SIZES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_JPEG_BARE = frozenset({0x01, *range(0xD0, 0xD9)})
NO_READING = (0, 65535)


def load(path: Path, camera: Camera, bytes_per_pixel: int) -> bytes:
    """An image file's content; CaptureError if it is larger than any image of that camera."""
    limit = 2 * bytes_per_pixel * camera.width * camera.height + _OVERHEAD
    size = path.stat().st_size
    if size > limit:
        raise CaptureError(path, expected=f"an image of at most {limit >> 10} KiB", found=f"{size >> 10} KiB")
    return path.read_bytes()


def read_depth(path: Path, content: bytes, camera: Camera, units: float) -> Depth:
    """Depth (height, width) in metres, 0 where the sensor has no reading (0 or 65535 in the file)."""
    size, form = _png_form(path, content)
    if form != (16, 0):
        raise CaptureError(
            path,
            expected="a grey PNG of 16 bits",
            found=f"{form[0]} bits{'' if form[1] == 0 else ' in colour or a palette'}",
            advice="depth of 8 bits has lost its millimetres",
        )
    _check_size(path, size, camera)
    image = _decoded(path, content, cv2.IMREAD_UNCHANGED)
    readings = image.astype(np.float32) / np.float32(units)
    readings[np.isin(image, NO_READING)] = 0.0
    return readings


def read_color(path: Path, camera: Camera) -> Image:
    """A colour image (height, width, 3), blue, green, red."""
    content = load(path, camera, 4)
    size = _png_form(path, content)[0] if content.startswith(_PNG) else _jpeg_size(path, content)
    _check_size(path, size, camera)
    # As the sensor saw it: a joint's pixel knows of no orientation that a phone or an editor noted down.
    flags = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION
    return _decoded(path, content, flags).astype(np.uint8)


def _decoded(path: Path, content: bytes, flags: int) -> NDArray[np.generic]:
    image = cv2.imdecode(np.frombuffer(content, dtype=np.uint8), flags)
    if image is None:
        raise CaptureError(path, expected="an image", found="damaged data")
    return np.asarray(image)


def _check_size(path: Path, size: tuple[int, int], camera: Camera) -> None:
    if size != (camera.width, camera.height):
        raise CaptureError(
            path,
            expected=f"{camera.width} x {camera.height} pixels, as camera.toml says",
            found=f"{size[0]} x {size[1]}",
        )


def _png_form(path: Path, content: bytes) -> tuple[tuple[int, int], tuple[int, int]]:
    """(width, height), (bits, colour type) of a whole PNG.

    Every chunk's sum is checked, so that a damaged file is told from a sound one before the decoder sees it,
    which complains on stderr by itself.
    """
    if not content.startswith(_PNG):
        raise CaptureError(path, expected="a PNG", found="something else" if content else "an empty file")
    form = ((0, 0), (0, 0))
    place = len(_PNG)
    while True:
        # Length, kind, data, sum: the rest is there if the sum is.
        length = int.from_bytes(content[place : place + 4], "big")
        kind = content[place + 4 : place + 8]
        end = place + 12 + length
        if end > len(content):
            raise _cut_off(path, "PNG")
        (announced,) = struct.unpack_from(">I", content, end - 4)
        if zlib.crc32(memoryview(content)[place + 4 : end - 4]) != announced:
            raise CaptureError(path, expected="a sound PNG", found="a chunk with a wrong sum")
        if place == len(_PNG):
            if kind != b"IHDR" or length != 13:
                raise CaptureError(path, expected="a PNG", found="no header in it")
            width, height, bits, colour = struct.unpack_from(">IIBB", content, place + 8)
            form = ((width, height), (bits, colour))
        if kind == b"IEND":
            return form
        place = end


def _cut_off(path: Path, kind: str) -> CaptureError:
    return CaptureError(path, expected=f"a whole {kind}", found="its end too early", advice="it is cut off")


def _jpeg_size(path: Path, content: bytes) -> tuple[int, int]:
    """(width, height) of a whole JPEG."""
    if not content.startswith(_JPEG):
        found = "something else" if content else "an empty file"
        raise CaptureError(path, expected="a PNG or JPEG", found=found)
    if _JPEG_END not in content[-64:]:
        raise _cut_off(path, "JPEG")
    place = 2
    while place + 9 <= len(content) and content[place] == 0xFF:
        marker = content[place + 1]
        if marker in _JPEG_SIZES:
            height, width = struct.unpack_from(">HH", content, place + 5)
            return width, height
        # A fill byte, a marker that stands alone, or a segment that says how long it is.
        if marker == 0xFF:
            place += 1
        elif marker in _JPEG_BARE:
            place += 2
        else:
            place += 2 + struct.unpack_from(">H", content, place + 2)[0]
    raise CaptureError(path, expected="a JPEG", found="no size in it")
