"""Intact images are read; any damage gives one line of error, before the decoder sees it."""

from __future__ import annotations

import io
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import ExifTags, Image
from samples.depth_scene import png

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.readers.depth.camera import Camera
from kinemimic.pipeline.readers.depth.frames import load, read_color, read_depth

CAMERA = Camera(64, 48, 60.0, 60.0, 32.0, 24.0)
IMAGE = np.random.default_rng(0).integers(500, 5000, (48, 64)).astype(np.uint16)


def chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def bomb() -> bytes:
    """A PNG of a few bytes that announces 60000 x 60000 pixels."""
    header = struct.pack(">IIBBBBB", 60000, 60000, 16, 0, 0, 0, 0)
    data = zlib.compress(bytes(1000))
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", data) + chunk(b"IEND", b"")


def jpeg(image: np.ndarray) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(image).save(stream, format="jpeg", quality=95)
    return stream.getvalue()


def test_millimetres_become_metres_and_no_reading_zero(tmp_path: Path) -> None:
    image = IMAGE.copy()
    image[3, 4], image[5, 6] = 0, 65535
    depth = read_depth(tmp_path, png(image), CAMERA, 1000.0)
    assert depth.dtype == np.float32
    assert depth[3, 4] == depth[5, 6] == 0
    assert depth[10, 10] == pytest.approx(image[10, 10] / 1000.0)
    assert read_depth(tmp_path, png(image), CAMERA, 5000.0)[10, 10] == pytest.approx(image[10, 10] / 5000.0)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "found an empty file"),
        (b"P5 64 48 65535\n", "found something else"),
        (png(IMAGE)[:-100], "found a truncated one"),
        (png(IMAGE)[:20], "found a truncated one"),
        (png(IMAGE)[:100] + b"\x00" + png(IMAGE)[101:], "found a chunk with a wrong checksum"),
        (png((IMAGE >> 8).astype(np.uint8)), "expected a 16-bit grey PNG, found 8 bits"),
        (png(np.zeros((48, 64, 3), np.uint8)), "found 8 bits in colour"),
        (png(IMAGE[:40]), "expected 64 x 48 pixels, as in camera.toml, found 64 x 40"),
        (bomb(), "found 60000 x 60000"),
    ],
)
def test_damage_is_one_line(
    tmp_path: Path, content: bytes, message: str, capfd: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(CaptureError, match=message):
        read_depth(tmp_path / "000007.png", content, CAMERA, 1000.0)
    assert capfd.readouterr().err == ""  # the decoder would have complained there


def test_a_file_beyond_all_measure_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "000000.png"
    with path.open("wb") as stream:
        stream.truncate(100 * 2**20)
    with pytest.raises(CaptureError, match="expected an image of at most"):
        load(path, CAMERA, 2)


@pytest.mark.parametrize("write", [png, jpeg], ids=["png", "jpeg"])
def test_colour_is_blue_green_red(tmp_path: Path, write: object) -> None:
    red = np.zeros((48, 64, 3), dtype=np.uint8)
    red[..., 0] = 250
    path = tmp_path / "0.any"
    path.write_bytes(write(red))  # type: ignore[operator]
    image = read_color(path, CAMERA)
    assert image.shape == (48, 64, 3)
    assert np.abs(image.astype(int) - [0, 0, 250]).max() < 8


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (jpeg(np.zeros((48, 64, 3), np.uint8))[:-200], "found a truncated one"),
        (jpeg(np.zeros((40, 64, 3), np.uint8)), "found 64 x 40"),
        (b"\xff\xd8\xff\xd9", "found no size in it"),
        (b"GIF89a", "expected a PNG or JPEG, found something else"),
    ],
)
def test_damaged_colour_is_one_line(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "000000.jpg"
    path.write_bytes(content)
    with pytest.raises(CaptureError, match=message):
        read_color(path, CAMERA)


def test_an_orientation_in_the_file_turns_nothing(tmp_path: Path) -> None:
    path, image = tmp_path / "0.jpg", np.zeros((48, 64, 3), dtype=np.uint8)
    image[:, :16, 0] = 250  # red at the left
    turned = Image.Exif()
    turned[ExifTags.Base.Orientation] = 6
    Image.fromarray(image).save(path, format="jpeg", quality=95, exif=turned)
    read = read_color(path, CAMERA)
    assert read.shape == (48, 64, 3)
    assert read[:, :12, 2].min() > 200 > 50 > read[:, 24:, 2].max()
