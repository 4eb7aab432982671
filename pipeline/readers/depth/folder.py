"""Layout of a depth recording's folder; cheap to import, because every capture is tested for it.

No file of the recording refers to another by name, so nothing in it can lead out of the folder.
"""

from __future__ import annotations

import re
from pathlib import Path

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.readers.base.format import Format

CAMERA_FILE, JOINTS_FILE, TIMES_FILE = "camera.toml", "joints.csv", "times.csv"
DEPTH_FOLDER, COLOR_FOLDER = "depth", "color"
DEPTH_SUFFIXES: tuple[str, ...] = (".png",)
COLOR_SUFFIXES: tuple[str, ...] = (".png", ".jpg", ".jpeg")
# Two hours at 30 Hz.
MAX_FRAMES = 216_000

FORMAT = Format(
    name="depth recording",
    sensor="any depth camera",
    holds="16-bit depth images and the joints' pixels, in a folder",
    recognised_by=f"{CAMERA_FILE} in the folder",
    sidecar_file=f"{JOINTS_FILE}, {DEPTH_FOLDER}/",
)
_NUMBER = re.compile(r"\d{1,12}")


def is_recording(path: Path) -> bool:
    """True for a folder that contains camera.toml."""
    return (path / CAMERA_FILE).is_file()


def numbered_images(folder: Path, suffixes: tuple[str, ...]) -> dict[int, Path]:
    """The images of a folder by frame number, ascending; empty if there is no such folder.

    A name begins with its number (000012.png, 000012_00000000400.jpg); other files are ignored. Raises
    CaptureError for two images with one number, or more than MAX_FRAMES.
    """
    images: dict[int, Path] = {}
    if not folder.is_dir():
        return images
    for path in folder.iterdir():
        number = _NUMBER.match(path.name)
        if number is None or path.suffix.lower() not in suffixes or not path.is_file():
            continue
        frame = int(number.group())
        if frame in images:
            names = " and ".join(sorted((images[frame].name, path.name)))
            raise CaptureError(
                folder, expected="one image per frame", found=f"{names}", where=f"frame {frame}"
            )
        images[frame] = path
        if len(images) > MAX_FRAMES:
            raise CaptureError(folder, expected=f"at most {MAX_FRAMES} images", found="more")
    return dict(sorted(images.items()))
