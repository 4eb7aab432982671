"""Solids as seen by a camera: the first solid on each ray, by exact intersection."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kinemimic.evaluate.film.camera import Camera, Floats, Part
from kinemimic.evaluate.film.solids import Box, Capsule, Cylinder, Solid

NEAR = 0.1  # m: nothing closer to the camera is drawn
FAR = np.float32(np.inf)


@dataclass(frozen=True)
class Surface:
    """What a part of a picture shows of the solids, at its sub-pixels (H, W).

    depth: distance (H, W) along their rays, m, infinite where there is no solid; where: (N,) indices, into
    the flattened (H, W), of those that show one; rays, normals: (N, 3) at these, in the camera's axes;
    colors: (N, 3), 0 to 1.
    """

    depth: Floats
    where: NDArray[np.intp]
    rays: Floats
    normals: Floats
    colors: Floats


def cast(camera: Camera, solids: Sequence[Solid], part: Part, rays: Floats) -> Surface:
    """The solids in a part of the picture, of which `rays` are `Camera.rays`."""
    left, top, right, bottom = part
    samples = rays.shape[0] // (bottom - top)
    depth = np.full(rays.shape[:2], FAR, np.float32)
    nearest = np.full(rays.shape[:2], -1, np.int16)
    for k, solid in enumerate(solids):
        own = bounds(camera, [solid])
        x0, y0 = (samples * (max(a, b) - b) for a, b in ((own[0], left), (own[1], top)))
        x1, y1 = (samples * (min(a, b) - c) for a, b, c in ((own[2], right, left), (own[3], bottom, top)))
        if x1 <= x0 or y1 <= y0:
            continue
        window = np.s_[y0:y1, x0:x1]
        found = _distance(camera, solid, rays[window])
        closer = found < depth[window]
        np.copyto(depth[window], found, where=closer)
        np.copyto(nearest[window], k, where=closer)
    where = np.flatnonzero(nearest >= 0)
    seen, which = rays.reshape(-1, 3).take(where, axis=0), nearest.ravel()[where]
    points = depth.ravel()[where, None] * seen
    normals, colors = np.zeros_like(seen), np.zeros_like(seen)
    for k, solid in enumerate(solids):
        own_points = np.flatnonzero(which == k)
        if len(own_points):
            normals[own_points] = _normals(camera, solid, points[own_points])
            colors[own_points] = solid.color
    return Surface(depth, where, seen, normals, colors)


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


def _distance(camera: Camera, solid: Solid, rays: Floats) -> Floats:
    """Distance (H, W) at which the rays meet a solid; infinite where they do not."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        if isinstance(solid, Box):
            return _to_box(camera, solid, rays)
        if isinstance(solid, Capsule):
            return _to_capsule(camera, solid, rays)
        return _to_cylinder(camera, solid, rays)


def _side(start: Floats, axis: Floats, radius: np.float32, rays: Floats) -> tuple[Floats, Floats, Floats]:
    """Distance (H, W) to the side between the ends of a cylinder, infinite where there is none; the rays'
    products (H, W) with the axis, from its start to its end; and its length squared."""
    length2 = axis @ axis
    # The infinite cylinder, in units that spare divisions by the length.
    along, from_start = rays @ axis, start @ axis
    a, b = length2 - along * along, from_start * along - length2 * (rays @ start)
    c = length2 * (start @ start) - from_start * from_start - radius * radius * length2
    root = b * b - a * c
    distance = (-b - np.sqrt(root)) / a
    at = distance * along - from_start
    hit = (root >= 0) & (at > 0) & (at < length2) & (distance > NEAR)
    return np.where(hit, distance, FAR), along, length2


def _to_capsule(camera: Camera, solid: Capsule, rays: Floats) -> Floats:
    start, end = camera.to_camera(np.stack([solid.start, solid.end])).astype(np.float32)
    radius = np.float32(solid.radius)
    ends = [start]
    depth = np.full(rays.shape[:2], FAR, np.float32)
    if (end != start).any():
        depth, _, _ = _side(start, end - start, radius, rays)
        ends.append(end)
    for center in ends:
        b = rays @ center
        root = b * b - (center @ center - radius * radius)
        distance = b - np.sqrt(root)
        np.copyto(depth, distance, where=(root >= 0) & (distance > NEAR) & (distance < depth))
    return depth


def _to_cylinder(camera: Camera, solid: Cylinder, rays: Floats) -> Floats:
    center = camera.to_camera(solid.center).astype(np.float32)
    half = (camera.axes @ solid.axes[:, 2] * solid.half).astype(np.float32)
    radius = np.float32(solid.radius)
    depth, along, _ = _side(center - half, 2 * half, radius, rays)
    for end in (center - half, center + half):
        distance = 2 * (end @ half) / along
        off = distance[..., None] * rays - end
        inside = np.einsum("hwi,hwi->hw", off, off) <= radius * radius
        np.copyto(depth, distance, where=inside & (distance > NEAR) & (distance < depth))
    return depth


def _to_box(camera: Camera, solid: Box, rays: Floats) -> Floats:
    axes = (camera.axes @ solid.axes).astype(np.float32)  # from the box's axes to the camera's
    origin = (-camera.to_camera(solid.center) @ axes).astype(np.float32)
    inverse = 1.0 / (rays @ axes)
    middle, half = -inverse * origin, np.abs(inverse) * solid.half.astype(np.float32)
    enter, leave = middle - half, middle + half
    # Over three numbers, one by one is faster than a reduction.
    near = np.maximum(np.maximum(enter[..., 0], enter[..., 1]), enter[..., 2])
    far = np.minimum(np.minimum(leave[..., 0], leave[..., 1]), leave[..., 2])
    return np.where((near <= far) & (near > NEAR), near, FAR)


def _normals(camera: Camera, solid: Solid, points: Floats) -> Floats:
    """Unit normals (N, 3) at points (N, 3) of a solid's surface, in the camera's axes."""
    if isinstance(solid, Capsule):
        start, end = camera.to_camera(np.stack([solid.start, solid.end])).astype(np.float32)
        axis, off = end - start, points - start
        share = np.clip(off @ axis / max(axis @ axis, np.float32(1e-12)), 0, 1)
        normal = off - share[:, None] * axis
        return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True), np.float32)
    axes = (camera.axes @ solid.axes).astype(np.float32)
    own = (points - camera.to_camera(solid.center).astype(np.float32)) @ axes
    normal = np.zeros_like(points)
    if isinstance(solid, Box):
        face = np.abs(np.abs(own) - solid.half.astype(np.float32)).argmin(axis=1)
    else:
        normal[:, :2] = own[:, :2] / np.float32(solid.radius)
        flat = np.abs(np.abs(own[:, 2]) - solid.half) < np.abs(np.hypot(own[:, 0], own[:, 1]) - solid.radius)
        normal[flat, :2] = 0
        face = np.where(flat, 2, -1)
    rows = np.flatnonzero(face >= 0)
    normal[rows, face[rows]] = np.sign(own[rows, face[rows]])
    return normal @ axes.T
