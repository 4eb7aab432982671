"""Depth images of known geometry, seen through a distorting lens, and whole recordings of the known walk.

Nothing here uses OpenCV's lens or the project's camera: rays are found by Newton's method on the written-out
distortion, and surfaces by intersecting them, so that both sides of a test do not share a mistake.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.skeleton import BONES, NODE_INDEX, NODES
from samples.motion import walk

Capsule = tuple[Array, Array, float]
Frame = NDArray[np.uint16]


@dataclass(frozen=True)
class Lens:
    """A camera; distortion in OpenCV's sequence k1, k2, p1, p2, k3, k4, k5, k6."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...]

    def bend(self, rays: Array) -> Array:
        """Distorted x'', y'' (..., 2) of x', y' (..., 2)."""
        k1, k2, p1, p2, k3, k4, k5, k6 = self.distortion
        x, y = rays[..., 0], rays[..., 1]
        s = x * x + y * y
        radial = (1 + s * (k1 + s * (k2 + s * k3))) / (1 + s * (k4 + s * (k5 + s * k6)))
        return np.stack(
            [
                x * radial + 2 * p1 * x * y + p2 * (s + 2 * x * x),
                y * radial + p1 * (s + 2 * y * y) + 2 * p2 * x * y,
            ],
            axis=-1,
        )

    def straighten(self, bent: Array) -> Array:
        """The inverse of `bend`, by Newton's method with a numerical Jacobian."""
        rays, step = bent.copy(), 1e-6
        for _ in range(30):
            off = self.bend(rays) - bent
            columns = [(self.bend(rays + e) - self.bend(rays - e)) / (2 * step) for e in step * np.eye(2)]
            rays = rays - np.linalg.solve(np.stack(columns, axis=-1), off[..., None])[..., 0]
        return rays

    def project(self, points: Array) -> Array:
        """Pixels (..., 2) of points (..., 3)."""
        bent = self.bend(points[..., :2] / points[..., 2:])
        return bent * [self.fx, self.fy] + [self.cx, self.cy]

    @cached_property
    def rays(self) -> Array:
        """Directions (height, width, 3), z = 1, of the middles of the pixels."""
        u, v = np.meshgrid(np.arange(self.width), np.arange(self.height))
        bent = np.stack([(u - self.cx) / self.fx, (v - self.cy) / self.fy], axis=-1)
        return np.concatenate([self.straighten(bent), np.ones((*u.shape, 1))], axis=-1)


# The depth camera of an Azure Kinect in its narrow mode, coefficients as such a device reports them.
RATIONAL = (3.130577, 2.324939, 8.1e-5, -5.1e-5, 0.1304, 3.458652, 3.350115, 0.66294)
AZURE = Lens(640, 576, 504.0, 504.0, 320.0, 326.0, RATIONAL)
# The same at half size, for recordings; and a lens that a Kinect v1's infrared camera may have.
HALF = Lens(320, 288, 252.0, 252.0, 159.75, 162.75, RATIONAL)
BARREL = Lens(320, 240, 285.6, 285.6, 160.3, 119.2, (-0.27, 0.17, 1e-3, -8e-4, -0.05, 0.0, 0.0, 0.0))

MOUNT = (1.0, 6.0)  # height in metres, tilt in degrees
_RADII = {"hip_center": 0.12, "spine": 0.13, "shoulder_center": 0.08, "hip": 0.09, "knee": 0.06}
_LIMB = 0.05


def plane(lens: Lens, normal: Array, distance: float) -> Array:
    """Depths (H, W) of the plane normal . p = distance."""
    facing = lens.rays @ normal
    return np.where(facing * distance > 0, distance / np.where(facing == 0, 1.0, facing), np.inf)


def sphere(lens: Lens, centre: Array, radius: float) -> Array:
    """Depths (H, W) of a sphere; infinite beside it."""
    return _sphere(lens.rays, centre, radius)


def _sphere(rays: Array, centre: Array, radius: float) -> Array:
    a, b = np.sum(rays * rays, axis=-1), rays @ centre
    inner = b * b - a * (centre @ centre - radius * radius)
    return np.where(inner >= 0, (b - np.sqrt(np.maximum(inner, 0))) / a, np.inf)


def _capsule(rays: Array, start: Array, end: Array, radius: float) -> Array:
    axis = end - start
    length = float(np.linalg.norm(axis))
    nearest = np.minimum(_sphere(rays, start, radius), _sphere(rays, end, radius))
    if length < 1e-6:
        return nearest
    axis = axis / length
    across, off = rays - (rays @ axis)[..., None] * axis, -start + (start @ axis) * axis
    a, b = np.sum(across * across, axis=-1), across @ off
    inner = b * b - a * (off @ off - radius * radius)
    depth = (-b - np.sqrt(np.maximum(inner, 0))) / np.maximum(a, 1e-12)
    along = depth * (rays @ axis) - start @ axis
    return np.minimum(nearest, np.where((inner >= 0) & (along >= 0) & (along <= length), depth, np.inf))


def body(joints: Array) -> list[Capsule]:
    """Capsules about the bones of joints (20, 3), in the same axes."""
    parts = [
        (joints[NODE_INDEX[a]], joints[NODE_INDEX[b]], _RADII.get(a, _RADII.get(a.rsplit("_", 1)[0], _LIMB)))
        for a, b in BONES
    ]
    head = joints[NODE_INDEX["head"]]
    return [*parts, (head, head, 0.10)]


def render(lens: Lens, capsules: Sequence[Capsule], background: Array) -> Array:
    """Depths (H, W) of capsules before a background (H, W), each looked for where it can be seen."""
    depth = background.copy()
    for start, end, radius in capsules:
        ends = np.stack([start, end])
        reach = 1.3 * lens.fx * radius / ends[:, 2].min() + 3
        pixels = lens.project(ends)
        left, top = np.maximum(np.floor(pixels.min(axis=0) - reach), 0).astype(int)
        right, below = np.ceil(pixels.max(axis=0) + reach).astype(int)
        box = np.s_[top : max(below, 0), left : max(right, 0)]
        if depth[box].size:
            depth[box] = np.minimum(depth[box], _capsule(lens.rays[box], start, end, radius))
    return depth


def millimetres(depth: Array) -> Frame:
    """As a sensor writes it: whole millimetres, 0 for nothing."""
    return np.where(np.isfinite(depth) & (depth < 60), np.rint(1000 * depth), 0).astype(np.uint16)


def png(image: NDArray[np.generic]) -> bytes:
    """A PNG of 16 or 8 bits."""
    stream = io.BytesIO()
    Image.fromarray(image).save(stream, format="png")
    return stream.getvalue()


def lens_toml(lens: Lens, table: str = "") -> str:
    """The lines of a lens in camera.toml, in a table of that name or at the top."""
    names = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
    bends = "\n".join(f"{name} = {value}" for name, value in zip(names, lens.distortion, strict=True))
    return (
        f"width = {lens.width}\nheight = {lens.height}\nfx = {lens.fx}\nfy = {lens.fy}\n"
        f"cx = {lens.cx}\ncy = {lens.cy}\n[{table}distortion]\n{bends}\n"
    )


def camera_toml(lens: Lens) -> str:
    """The text of camera.toml with a mount."""
    mount = f"[mount]\nheight = {MOUNT[0]}\ntilt = {MOUNT[1]}\n"
    return "kinemimic_depth = 1\nrate = 30.0\n" + lens_toml(lens) + mount


def to_camera(points: Array) -> Array:
    """Points of our world (camera over the origin, looking along +X, tilted down) in the camera's axes."""
    height, tilt = MOUNT[0], np.radians(MOUNT[1])
    c, s = np.cos(tilt), np.sin(tilt)
    x, y, z = points[..., 0], points[..., 1], points[..., 2] - height
    return np.stack([-y, -s * x - c * z, c * x - s * z], axis=-1)


def walker(frames: int = 60) -> Array:
    """The known walk (frames, 20, 3) in our world, coming towards the camera."""
    joints = walk(frames).joints
    return np.stack([4.6 - joints[..., 0], 0.3 - joints[..., 1], joints[..., 2]], axis=-1)


def joints_csv(pixels: Array, depth: Array | None, names: Sequence[str] = NODES) -> str:
    """joints.csv of pixels (T, J, 2) and depths (T, J) in metres; NaN are left out."""
    lines = ["frame,joint,u,v" + (",depth" if depth is not None else "")]
    for frame, row in enumerate(pixels):
        for joint, (u, v) in enumerate(row):
            more = "" if depth is None else f",{1000 * depth[frame, joint]:.1f}"
            if np.isfinite(u):
                lines.append(f"{frame},{names[joint]},{u:.2f},{v:.2f}{more}")
    return "\n".join(lines) + "\n"


def write_recording(
    folder: Path,
    frames: int = 60,
    *,
    lens: Lens = HALF,
    with_depth: bool = True,
    damage: Callable[[int, Frame], Frame] = lambda frame, image: image,
    color: Mapping[int, NDArray[np.uint8]] | None = None,
    rendered: bool = True,
) -> Array:
    """A recording of the known walk in a room; returns the joints (frames, 20, 3) in our world.

    damage: what becomes of each depth image; rendered: False puts no body into the room (quick; then only the
    joints' own depths tell of one).
    """
    joints = walker(frames)
    seen = to_camera(joints)
    room = np.minimum(plane(lens, to_camera(np.array([6.0, 0, 1.0])) * [0, 0, 1], 36.0), _floor(lens))
    (folder / "depth").mkdir(parents=True)
    for frame, figure in enumerate(seen):
        image = millimetres(render(lens, body(figure), room) if rendered else room)
        (folder / "depth" / f"{frame:06d}.png").write_bytes(png(damage(frame, image)))
    if color:
        (folder / "color").mkdir()
        for frame, picture in color.items():
            (folder / "color" / f"{frame:06d}.png").write_bytes(png(picture))
    (folder / "camera.toml").write_text(camera_toml(lens))
    (folder / "joints.csv").write_text(joints_csv(lens.project(seen), seen[..., 2] if with_depth else None))
    return joints


def _floor(lens: Lens) -> Array:
    tilt = np.radians(MOUNT[1])
    return plane(lens, np.array([0.0, np.cos(tilt), np.sin(tilt)]), MOUNT[0])
