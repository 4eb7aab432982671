"""Solids as seen by a camera: the first solid on each ray, by exact intersection."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kinemimic.evaluate.film.camera import Camera, Floats, Part
from kinemimic.evaluate.film.solids import Box, Capsule, Solid

NEAR = 0.1  # m: nothing closer to the camera is drawn
FAR = np.float32(np.inf)


@dataclass(frozen=True)
class Surface:
    """What a part of a picture shows of the solids, at its sub-pixels (H, W).

    rays: their unit directions (H, W, 3) in the camera's axes; depth: distance (H, W) along them, m, infinite
    where there is none; normals: (H, W, 3) in the camera's axes; colors: (H, W, 3), 0 to 1.
    """

    rays: Floats
    depth: Floats
    normals: Floats
    colors: Floats

    @property
    def hit(self) -> NDArray[np.bool_]:
        """Whether there is a solid (H, W)."""
        return np.isfinite(self.depth)


def cast(camera: Camera, solids: Sequence[Solid], part: Part, rays: Floats) -> Surface:
    """The solids in a part of the picture, of which `rays` are `Camera.rays`."""
    left, top, right, bottom = part
    samples = rays.shape[0] // (bottom - top)
    shape = rays.shape[:2]
    depth = np.full(shape, FAR, np.float32)
    normals, colors = np.zeros_like(rays), np.zeros_like(rays)
    for solid in solids:
        own = bounds(camera, [solid])
        x0, y0 = (samples * (max(a, b) - b) for a, b in ((own[0], left), (own[1], top)))
        x1, y1 = (samples * (min(a, b) - c) for a, b, c in ((own[2], right, left), (own[3], bottom, top)))
        if x1 <= x0 or y1 <= y0:
            continue
        window = np.s_[y0:y1, x0:x1]
        found, normal = _meet(camera, solid, rays[window])
        closer = found < depth[window]
        depth[window][closer] = found[closer]
        normals[window][closer] = normal[closer]
        colors[window][closer] = solid.color
    return Surface(rays, depth, normals, colors)


def bounds(camera: Camera, solids: Sequence[Solid], margin: int = 1) -> Part:
    """The part of the picture outside of which there is no solid."""
    width, height = camera.size
    low, high = np.full(2, np.inf), np.full(2, -np.inf)
    for solid in solids:
        points, radius = solid.extent()
        seen = camera.to_camera(points)
        if (seen[:, 2] - radius < NEAR).any():
            if (seen[:, 2] + radius < NEAR).all():
                continue
            return 0, 0, width, height
        # The slopes of the two tangents to a circle, across and ahead.
        across, ahead = seen[:, :2], seen[:, 2:]
        root = radius * np.sqrt(across**2 + ahead**2 - radius**2)
        for sign in (-1, 1):
            slope = (across * ahead + sign * root) / (ahead**2 - radius**2)
            edge = camera.focal * slope + 0.5 * np.array(camera.size)
            low, high = np.minimum(low, edge.min(0)), np.maximum(high, edge.max(0))
    if not np.isfinite(low).all():
        return 0, 0, 0, 0
    left, top = np.clip(np.floor(low) - margin, 0, (width, height)).astype(int).tolist()
    right, bottom = np.clip(np.ceil(high) + margin, 0, (width, height)).astype(int).tolist()
    return (left, top, right, bottom) if left < right and top < bottom else (0, 0, 0, 0)


def _meet(camera: Camera, solid: Solid, rays: Floats) -> tuple[Floats, Floats]:
    """Distance (H, W), infinite without a hit, and normal (H, W, 3) where the rays meet a solid."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        if isinstance(solid, Box):
            return _meet_box(camera, solid, rays)
        return _meet_capsule(camera, solid, rays)


def _meet_capsule(camera: Camera, solid: Capsule, rays: Floats) -> tuple[Floats, Floats]:
    start, end = camera.to_camera(np.stack([solid.start, solid.end])).astype(np.float32)
    radius, axis = np.float32(solid.radius), end - start
    length2 = axis @ axis
    depth = np.full(rays.shape[:2], FAR, np.float32)
    along = np.zeros_like(depth)  # where on the axis, 0 to length2
    if length2 > 0:
        # The infinite cylinder, in units that spare divisions by the length.
        da, ds = rays @ axis, rays @ start
        sa = start @ axis
        a, b = length2 - da * da, sa * da - length2 * ds
        c = length2 * (start @ start) - sa * sa - radius * radius * length2
        root = b * b - a * c
        t = (-b - np.sqrt(root)) / a
        at = t * da - sa
        side = (root >= 0) & (at > 0) & (at < length2) & (t > NEAR)
        depth[side], along[side] = t[side], at[side]
    for center, place in ((start, np.float32(0.0)), (end, length2)):
        b = rays @ center
        root = b * b - (center @ center - radius * radius)
        t = b - np.sqrt(root)
        cap = (root >= 0) & (t > NEAR) & (t < depth)
        depth[cap], along[cap] = t[cap], place
    hit, normal = np.isfinite(depth), np.zeros_like(rays)
    share = along[hit] / length2 if length2 > 0 else along[hit]
    normal[hit] = (depth[hit][:, None] * rays[hit] - start - share[:, None] * axis) / radius
    return depth, normal


def _meet_box(camera: Camera, solid: Box, rays: Floats) -> tuple[Floats, Floats]:
    axes = (camera.axes @ solid.axes).astype(np.float32)  # from the box's axes to the camera's
    origin = (-camera.to_camera(solid.center) @ axes).astype(np.float32)
    own = rays @ axes
    inverse = 1.0 / own
    middle, half = -inverse * origin, np.abs(inverse) * solid.half.astype(np.float32)
    enter, leave = middle - half, middle + half
    # Over three numbers, one by one is faster than a reduction.
    near = np.maximum(np.maximum(enter[..., 0], enter[..., 1]), enter[..., 2])
    far = np.minimum(np.minimum(leave[..., 0], leave[..., 1]), leave[..., 2])
    hit = (near <= far) & (near > NEAR)
    depth, normal = np.where(hit, near, FAR).astype(np.float32), np.zeros_like(rays)
    face = enter[hit].argmax(axis=-1)
    sign = -np.sign(np.take_along_axis(own[hit], face[:, None], -1))
    normal[hit] = sign * axes.T[face]
    return depth, normal
