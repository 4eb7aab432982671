"""camera.toml of a depth recording: the cameras, the unit of depth, the clock, and how the camera stands."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.files.toml_keys import Keys, parse_toml
from kinemimic.pipeline.kinematics.rotations import from_matrix, rotate
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.depth.camera import Camera

SCHEMA = 1
SCHEMA_KEY = "kinemimic_depth"
MILLIMETRES = 1000.0
# The largest depth image that any camera gives has 4 megapixels, the largest colour image 12.
_SIDE = 8192
MAX_PIXELS = 2**24
_COEFFICIENTS = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")


@dataclass(frozen=True)
class Mount:
    """How the depth camera stands.

    up: (3,) in its axes (x right, y down, z forward); height: over the floor, metres. The world has Z up and
    X forward; its origin lies on the floor below the camera.
    """

    up: tuple[float, float, float] = (0.0, -1.0, 0.0)
    height: float = 0.0

    @property
    def world_from_camera(self) -> Array:
        """(4,) the rotation from the camera's axes to the world's."""
        up = np.array(self.up)
        forward = np.array([0.0, 0.0, 1.0]) - up[2] * up
        forward /= np.linalg.norm(forward)
        return from_matrix(np.stack([forward, np.cross(up, forward), up]))

    def from_floor(self, points: Array) -> Array:
        """Points (..., 3) in the camera's axes, counted from the origin on the floor."""
        return points + self.height * np.array(self.up)

    def to_camera(self, points: Array) -> Array:
        """Points (..., 3) of the world in the camera's axes."""
        turn = self.world_from_camera * [-1.0, -1.0, -1.0, 1.0]
        return rotate(turn, points) - self.height * np.array(self.up)


@dataclass(frozen=True)
class ColorCamera:
    """camera: the lens; rotation (3, 3), translation (3,) metres: from the depth camera's axes to its own."""

    camera: Camera
    rotation: Array
    translation: Array

    def from_depth(self, points: Array) -> Array:
        """Points (..., 3) in the depth camera's axes in those of this camera."""
        return points @ self.rotation.T + self.translation


@dataclass(frozen=True)
class Setup:
    """camera: of the depth images; units: of their depth in a metre; rate: frames a second, None if times.csv
    has the times; leveled: whether the file says how the camera stands; color: the colour camera, None if
    colour images have the depth images' pixels.
    """

    camera: Camera
    units: float
    rate: float | None
    mount: Mount
    leveled: bool
    color: ColorCamera | None


def read_setup(source: Source) -> Setup:
    """What camera.toml says; CaptureError names the key of the first mistake."""
    keys = Keys(source.path, "", parse_toml(source.path, source.text))
    version = keys.get(SCHEMA_KEY)
    if isinstance(version, bool) or version != SCHEMA:
        found = "none" if version is None else repr(version)
        keys.fail(SCHEMA_KEY, expected=f"{SCHEMA}, the version of this description", found=found)
    camera = _camera(keys)
    units = keys.number("units_per_metre", 1.0, 1e6) or MILLIMETRES
    rate = keys.number("rate", 0.1, 1000.0)
    mounted = keys.table("mount")
    mount = _mount(mounted)
    own = keys.table("color")
    color = _color(own) if own.values else None
    keys.finish()
    return Setup(camera, units, rate, mount, bool(mounted.values), color)


def _camera(keys: Keys) -> Camera:
    width, height = _side(keys, "width"), _side(keys, "height")
    if width * height > MAX_PIXELS:
        keys.fail("width", expected=f"at most {MAX_PIXELS} pixels", found=f"{width} x {height}")
    fx, fy = (_needed(keys, key, 1.0, 1e5) for key in ("fx", "fy"))
    cx, cy = (_needed(keys, key, -1e4, 1e5) for key in ("cx", "cy"))
    lens = keys.table("distortion")
    distortion = tuple(lens.number(key, -1e4, 1e4) or 0.0 for key in _COEFFICIENTS)
    lens.finish()
    return Camera(width, height, fx, fy, cx, cy, distortion)


def _side(keys: Keys, key: str) -> int:
    value = keys.whole(key, 0, 8, _SIDE)
    if not value:
        keys.fail(key, expected=f"pixels, a whole number from 8 to {_SIDE}", found="none")
    return value


def _needed(keys: Keys, key: str, low: float, high: float) -> float:
    value = keys.number(key, low, high)
    if value is None:
        keys.fail(key, expected=f"pixels, a number from {low:g} to {high:g}", found="none")
    return value


def _mount(keys: Keys) -> Mount:
    floor = keys.numbers("floor", 4)
    height, tilt = keys.number("height", -10.0, 10.0), keys.number("tilt", -89.0, 89.0)
    keys.finish()
    if floor is not None:
        return _above(keys, floor, {"height": height, "tilt": tilt})
    radians = np.radians(tilt or 0.0)
    return Mount((0.0, -float(np.cos(radians)), -float(np.sin(radians))), height or 0.0)


def _above(keys: Keys, floor: tuple[float, ...], others: Mapping[str, float | None]) -> Mount:
    """The mount over a floor plane a x + b y + c z + d = 0 in the camera's axes."""
    for key, value in others.items():
        if value is not None:
            keys.fail(key, expected="either floor or height and tilt", found="both")
    plane = np.array(floor)
    length = float(np.linalg.norm(plane[:3]))
    # Up is against y, whichever way the plane's normal was written.
    if abs(plane[1]) < 0.02 * length or length == 0.0:
        keys.fail("floor", expected="the plane of a floor (y is down)", found=repr(list(floor)))
    plane *= -np.sign(plane[1]) / length
    if abs(plane[3]) > 10.0:
        keys.fail("floor", expected="a camera within 10 m of its floor", found=f"{plane[3]:g} m")
    return Mount((float(plane[0]), float(plane[1]), float(plane[2])), float(plane[3]))


def _color(keys: Keys) -> ColorCamera:
    camera = _camera(keys)
    turn = np.array(keys.numbers("rotation", 9) or np.eye(3).ravel()).reshape(3, 3)
    if np.abs(turn @ turn.T - np.eye(3)).max() > 1e-3 or np.linalg.det(turn) < 0:
        keys.fail("rotation", expected="the nine numbers of a rotation matrix, row by row", found="none such")
    translation = np.array(keys.numbers("translation", 3) or (0.0, 0.0, 0.0))
    if np.abs(translation).max() > 10.0:
        keys.fail("translation", expected="metres, at most 10", found=repr(translation.tolist()))
    keys.finish()
    return ColorCamera(camera, turn, translation)


def setup_of(folder: Path, name: str) -> tuple[Setup, Source]:
    """The setup in a recording's folder, and the file that it was read from."""
    source = Source.open(folder / name)
    if not source.is_text:
        raise CaptureError(source.path, expected="TOML", found="a binary file")
    return read_setup(source), source
