"""One frame: the simulated figure and its reference as a ghost, on a floor."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from kinemimic.evaluate.film.camera import Camera, Floats
from kinemimic.evaluate.film.floor import draw_floor
from kinemimic.evaluate.film.looks import GHOST, LIGHT, Look
from kinemimic.evaluate.film.raycast import Surface, bounds, cast
from kinemimic.evaluate.film.solids import Solid
from kinemimic.pipeline.arrays import Array

Picture = NDArray[np.uint8]  # (height, width, 3): red, green, blue

SAMPLES = 2  # sub-pixels of a pixel along each axis
GHOST_OPACITY, GHOST_RIM = 0.42, 0.50  # facing the camera, and added at the edge
OUTLINE_OPACITY = 0.85
GAP = 0.0025  # gaps between limbs that have no outline, radians of view


def draw_frame(
    camera: Camera, look: Look, figure: Sequence[Solid], ghost: Sequence[Solid], around: Array
) -> Picture:
    """The picture of a frame. around: (2,) m, the point of the floor below the figure.

    The ghost is drawn behind the figure, and its outline in front, so that a figure that covers its ghost
    does not flicker and a deviation is still visible.
    """
    picture = draw_floor(camera, look, figure, around)
    part = bounds(camera, [*figure, *ghost])
    if part[2] <= part[0]:
        return _bytes(picture)
    left, top, right, bottom = part
    below = picture[top:bottom, left:right]
    rays = camera.rays(part, SAMPLES)
    pale, solid = cast(camera, ghost, part, rays), cast(camera, figure, part, rays)
    below = _over(below, *lit(pale, look, (GHOST_OPACITY, GHOST_RIM)))
    below = _over(below, *lit(solid, look, (1.0, 0.0)))
    line = _outline(pale, max(1, round(GAP * camera.focal))) * np.float32(OUTLINE_OPACITY)
    below = _over(below, np.broadcast_to(np.array(GHOST, np.float32), (*line.shape, 3)), line)
    picture[top:bottom, left:right] = below
    return _bytes(picture)


def lit(surface: Surface, look: Look, opacity: tuple[float, float]) -> tuple[Floats, Floats]:
    """Colours (H, W, 3) of a surface in the light, 0 to 1, and its opacity (H, W).

    opacity: where the surface faces the camera, and what is added at its edge.
    """
    hit = surface.hit
    normals, rays = surface.normals[hit], surface.rays[hit]
    toward = np.array([LIGHT[1], -LIGHT[2], LIGHT[0]], np.float32)
    diffuse = np.clip(normals @ toward, 0, 1)
    # The sky lights what faces up, the floor a little what faces down.
    up = 0.5 - 0.5 * normals[:, 1]
    half = toward - rays
    half /= np.sqrt(np.einsum("ni,ni->n", half, half))[:, None]
    gloss = np.clip(np.einsum("ni,ni->n", normals, half), 0, 1)
    for _ in range(5):  # to the power of 32, faster than ** by far
        gloss *= gloss
    light = look.ambient * (0.6 + 0.4 * up) + (1.1 - look.ambient) * diffuse
    colors, opacities = np.zeros_like(surface.rays), np.zeros(hit.shape, np.float32)
    colors[hit] = np.clip(surface.colors[hit] * light[:, None] + 0.18 * gloss[:, None], 0, 1)
    facing = np.clip(-np.einsum("ni,ni->n", normals, rays), 0, 1)
    edge = 1 - facing
    opacities[hit] = opacity[0] + opacity[1] * edge * edge * edge
    return colors, opacities


def _outline(surface: Surface, gap: int) -> Floats:
    """Opacity (H, W) of the line around everything that is hit; gaps below `gap` pixels have none."""
    gap, line = SAMPLES * gap, SAMPLES
    pad = gap + 1  # outside of the part there is nothing; OpenCV assumes otherwise
    hit = np.pad(surface.hit.astype(np.uint8), pad)
    wide, narrow = (
        cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1,) * 2) for radius in (gap, line)
    )
    whole = cv2.morphologyEx(hit, cv2.MORPH_CLOSE, wide)
    edge = (whole - cv2.erode(whole, narrow))[pad:-pad, pad:-pad]
    return edge.astype(np.float32)


def _over(below: Floats, color: Floats, opacity: Floats) -> Floats:
    """Colours (H, W, 3) at sub-pixels laid over a part of the picture with their opacity (H, W)."""
    height, width = below.shape[:2]
    layer = np.concatenate([color * opacity[..., None], opacity[..., None]], axis=-1)
    small = cv2.resize(layer, (width, height), interpolation=cv2.INTER_AREA)
    return np.asarray(small[..., :3] + below * (1 - small[..., 3:]), np.float32)


def _bytes(picture: Floats) -> Picture:
    return np.asarray(np.clip(picture, 0, 1) * 255 + 0.5, np.uint8)
