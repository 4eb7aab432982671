"""camera.toml of a depth recording: the cameras, the unit of depth, the clock, and the camera's mount."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from msgspec import Meta, Struct
from msgspec.structs import astuple

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.files.validation.records import RecordError, convert
from kinemimic.pipeline.files.validation.toml_file import parse_toml
from kinemimic.pipeline.kinematics.rotations import from_matrix, rotate
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.depth.camera import Camera

MILLIMETRES = 1000.0
# Depth images of today's cameras have up to 4 megapixels, colour images up to 12.
MAX_PIXELS = 2**24
_Side = Annotated[int, Meta(ge=8, le=8192, description="pixels, a whole number from 8 to 8192")]
_Focal = Annotated[float, Meta(ge=1.0, le=1e5, description="pixels, a number from 1 to 100000")]
_Centre = Annotated[float, Meta(ge=-1e4, le=1e5, description="pixels, a number from -10000 to 100000")]
_Factor = Annotated[float, Meta(ge=-1e4, le=1e4)]
_Metres = Annotated[float, Meta(ge=-10.0, le=10.0)]
_Finite = Annotated[float, Meta(ge=-1e6, le=1e6)]
_Nine = Annotated[tuple[_Finite, ...], Meta(min_length=9, max_length=9, description="9 numbers")]


class _Distortion(Struct, frozen=True, forbid_unknown_fields=True):
    k1: _Factor = 0.0
    k2: _Factor = 0.0
    p1: _Factor = 0.0
    p2: _Factor = 0.0
    k3: _Factor = 0.0
    k4: _Factor = 0.0
    k5: _Factor = 0.0
    k6: _Factor = 0.0


class _Lens(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    width: _Side
    height: _Side
    fx: _Focal
    fy: _Focal
    cx: _Centre
    cy: _Centre
    distortion: _Distortion = _Distortion()

    def __post_init__(self) -> None:
        if self.width * self.height > MAX_PIXELS:
            found = f"{self.width} x {self.height}"
            raise RecordError("width", expected=f"at most {MAX_PIXELS} pixels", found=found)

    @property
    def camera(self) -> Camera:
        distortion = astuple(self.distortion)
        return Camera(self.width, self.height, self.fx, self.fy, self.cx, self.cy, distortion)


class Mount(Struct, frozen=True, forbid_unknown_fields=True):
    """The pose of the depth camera: floor, a plane (a, b, c, d) in its axes (x right, y down, z forward); or
    height over the floor, metres, and tilt, degrees.

    The world has Z up and X forward; its origin lies on the floor below the camera.
    """

    floor: tuple[_Finite, _Finite, _Finite, _Finite] | None = None
    height: _Metres | None = None
    tilt: Annotated[float, Meta(ge=-89.0, le=89.0)] | None = None

    def __post_init__(self) -> None:
        if self.floor is None:
            return
        if self.height is not None or self.tilt is not None:
            raise RecordError("floor", expected="either floor or height and tilt", found="both")
        normal = np.abs(self.floor[:3])
        if normal[1] < 0.02 * np.linalg.norm(normal) or not normal.any():
            found = repr(list(self.floor))
            raise RecordError("floor", expected="the plane of a floor (y is down)", found=found)
        if abs(height := self.plane[3]) > 10.0:
            raise RecordError("floor", expected="a camera within 10 m of its floor", found=f"{height:g} m")

    @property
    def plane(self) -> Array:
        """(4,) up in the camera's axes, and the camera's height over the floor, metres."""
        if self.floor is None:
            radians = np.radians(self.tilt or 0.0)
            return np.array([0.0, -np.cos(radians), -np.sin(radians), self.height or 0.0])
        plane: Array = np.array(self.floor)
        # Up is opposite to y, regardless of the sign of the plane's normal in the file.
        plane *= -np.sign(plane[1]) / float(np.linalg.norm(plane[:3]))
        return plane

    @property
    def world_from_camera(self) -> Array:
        """(4,) the rotation from the camera's axes to the world's."""
        up = self.plane[:3]
        forward = np.array([0.0, 0.0, 1.0]) - up[2] * up
        forward /= np.linalg.norm(forward)
        return from_matrix(np.stack([forward, np.cross(up, forward), up]))

    def from_floor(self, points: Array) -> Array:
        """Points (..., 3) in the camera's axes, from the origin on the floor."""
        up, height = self.plane[:3], float(self.plane[3])
        return points + height * up

    def to_camera(self, points: Array) -> Array:
        """Points (..., 3) of the world in the camera's axes."""
        turn = self.world_from_camera * [-1.0, -1.0, -1.0, 1.0]
        up, height = self.plane[:3], float(self.plane[3])
        return rotate(turn, points) - height * up


class ColorCamera(_Lens, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A colour camera; rotation: matrix, row by row, and translation, metres, from the depth camera's axes
    to its own."""

    rotation: _Nine = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    translation: tuple[_Metres, _Metres, _Metres] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if np.abs(self._turn @ self._turn.T - np.eye(3)).max() > 1e-3 or np.linalg.det(self._turn) < 0:
            wanted = "the nine numbers of a rotation matrix, row by row"
            raise RecordError("rotation", expected=wanted, found="another matrix")

    @property
    def _turn(self) -> Array:
        turn: Array = np.array(self.rotation).reshape(3, 3)
        return turn

    def from_depth(self, points: Array) -> Array:
        """Points (..., 3) in the depth camera's axes in those of this camera."""
        moved: Array = points @ self._turn.T + np.array(self.translation)
        return moved


class Setup(
    _Lens, frozen=True, forbid_unknown_fields=True, kw_only=True, rename={"units": "units_per_metre"}
):
    """units: of depth, per metre; rate: frames a second, None if times.csv has the times; color: the colour
    camera, None if colour images have the depth images' pixels; the rest is the depth camera."""

    kinemimic_depth: Annotated[Literal[1], Meta(description="1, the version of this description")]
    units: Annotated[float, Meta(ge=1.0, le=1e6)] = MILLIMETRES
    rate: Annotated[float, Meta(ge=0.1, le=1000.0)] | None = None
    mount: Mount = Mount()
    color: ColorCamera | None = None

    @property
    def leveled(self) -> bool:
        """Whether the file gives the pose of the camera."""
        return self.mount != Mount()


def read_setup(source: Source) -> Setup:
    """The setup in camera.toml; CaptureError names the key of the first mistake."""
    return convert(parse_toml(source.path, source.text), Setup, source.path)


def setup_of(folder: Path, name: str) -> tuple[Setup, Source]:
    """The setup in a recording's folder, and the file that it was read from."""
    source = Source.open(folder / name)
    if not source.is_text:
        raise CaptureError(source.path, expected="TOML", found="a binary file")
    return read_setup(source), source
