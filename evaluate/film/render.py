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
    below = _over(below, lit(pale, look, (GHOST_OPACITY, GHOST_RIM)))
    below = _over(below, lit(solid, look, (1.0, 0.0)))
    below = _over(below, _outline(pale, max(1, round(GAP * camera.focal))))
    picture[top:bottom, left:right] = below
    return _bytes(picture)


def lit(surface: Surface, look: Look, opacity: tuple[float, float]) -> Floats:
    """A surface in the light (H, W, 4): its colours times its opacity, and its opacity, 0 to 1.

    opacity: where the surface faces the camera, and what is added at its edge.
    """
    normals, rays = surface.normals, surface.rays
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
    edge = 1 - np.clip(-np.einsum("ni,ni->n", normals, rays), 0, 1)
    shown = opacity[0] + opacity[1] * edge * edge * edge
    pixels = np.empty((len(normals), 4), np.float32)
    pixels[:, :3] = np.clip(surface.colors * light[:, None] + 0.18 * gloss[:, None], 0, 1) * shown[:, None]
    pixels[:, 3] = shown
    layer = np.zeros((*surface.depth.shape, 4), np.float32)
    layer.reshape(-1, 4)[surface.where] = pixels
    return layer


def _outline(surface: Surface, gap: int) -> Floats:
    """The line around the ghost as a layer like `lit`; gaps below `gap` pixels have none."""
    gap, line = SAMPLES * gap, SAMPLES
    pad = gap + 1  # outside of the part there is nothing; OpenCV assumes otherwise
    hit = np.pad(np.isfinite(surface.depth).astype(np.uint8), pad)
    wide, narrow = (
        cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1,) * 2) for radius in (gap, line)
    )
    whole = cv2.morphologyEx(hit, cv2.MORPH_CLOSE, wide)
    edge = (whole - cv2.erode(whole, narrow))[pad:-pad, pad:-pad]
    return edge[..., None] * np.array([*GHOST, 1.0], np.float32) * np.float32(OUTLINE_OPACITY)


def _over(below: Floats, layer: Floats) -> Floats:
    """A layer (H, W, 4) at sub-pixels, as for `lit`, laid over a part (h, w, 3) of the picture."""
    height, width = below.shape[:2]
    small = cv2.resize(layer, (width, height), interpolation=cv2.INTER_AREA)
    return np.asarray(small[..., :3] + below * (1 - small[..., 3:]), np.float32)


def _bytes(picture: Floats) -> Picture:
    return np.asarray(np.clip(picture, 0, 1) * 255 + 0.5, np.uint8)
