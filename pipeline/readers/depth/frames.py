"""Depth and colour images, read within bounds: header fields are checked before the image is decoded."""

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

# Allowance in addition to the pixels; a PNG of noise is slightly larger than its pixels.
_OVERHEAD = 2**20
_PNG = b"\x89PNG\r\n\x1a\n"
_JPEG = b"\xff\xd8"
_JPEG_END = b"\xff\xd9"
# Frame headers of JPEG (SOF0 to SOF15 without DHT, JPG, DAC) hold the size (ITU T.81, table B.1).
_JPEG_SIZES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_JPEG_WITHOUT_LENGTH = frozenset({0x01, *range(0xD0, 0xD9)})
NO_READING = (0, 65535)


def load(path: Path, camera: Camera, bytes_per_pixel: int) -> bytes:
    """An image file's content; CaptureError if it is larger than any image of that camera can be."""
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
            expected="a 16-bit grey PNG",
            found=f"{form[0]} bits{'' if form[1] == 0 else ' in colour or a palette'}",
            advice="8-bit depth has lost its resolution of millimetres",
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
    # In the sensor's orientation: joint pixels do not follow an EXIF orientation set by a phone or an editor.
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
            expected=f"{camera.width} x {camera.height} pixels, as in camera.toml",
            found=f"{size[0]} x {size[1]}",
        )


def _png_form(path: Path, content: bytes) -> tuple[tuple[int, int], tuple[int, int]]:
    """(width, height), (bits, colour type) of a complete PNG.

    Every chunk's checksum is verified, so that damaged files never reach the decoder, which writes to stderr.
    """
    if not content.startswith(_PNG):
        raise CaptureError(path, expected="a PNG", found="something else" if content else "an empty file")
    form = ((0, 0), (0, 0))
    offset = len(_PNG)
    while True:
        # Length, kind, data, checksum: if the checksum is inside the file, so is the rest.
        length = int.from_bytes(content[offset : offset + 4], "big")
        kind = content[offset + 4 : offset + 8]
        end = offset + 12 + length
        if end > len(content):
            raise _cut_off(path, "PNG")
        (checksum,) = struct.unpack_from(">I", content, end - 4)
        if zlib.crc32(memoryview(content)[offset + 4 : end - 4]) != checksum:
            raise CaptureError(path, expected="an intact PNG", found="a chunk with a wrong checksum")
        if offset == len(_PNG):
            if kind != b"IHDR" or length != 13:
                raise CaptureError(path, expected="a PNG", found="no header in it")
            width, height, bits, colour = struct.unpack_from(">IIBB", content, offset + 8)
            form = ((width, height), (bits, colour))
        if kind == b"IEND":
            return form
        offset = end


def _cut_off(path: Path, kind: str) -> CaptureError:
    return CaptureError(path, expected=f"a complete {kind}", found="a truncated one", advice="it is cut off")


def _jpeg_size(path: Path, content: bytes) -> tuple[int, int]:
    """(width, height) of a complete JPEG."""
    if not content.startswith(_JPEG):
        found = "something else" if content else "an empty file"
        raise CaptureError(path, expected="a PNG or JPEG", found=found)
    if _JPEG_END not in content[-64:]:
        raise _cut_off(path, "JPEG")
    offset = 2
    while offset + 9 <= len(content) and content[offset] == 0xFF:
        marker = content[offset + 1]
        if marker in _JPEG_SIZES:
            height, width = struct.unpack_from(">HH", content, offset + 5)
            return width, height
        # A fill byte, a marker without a length, or a segment with its length.
        if marker == 0xFF:
            offset += 1
        elif marker in _JPEG_WITHOUT_LENGTH:
            offset += 2
        else:
            offset += 2 + struct.unpack_from(">H", content, offset + 2)[0]
    raise CaptureError(path, expected="a JPEG", found="no size in it")
