"""The floor of a picture: a grid that fades into the background, and the soft shadows of solids."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from kinemimic.evaluate.film.camera import Camera, Floats
from kinemimic.evaluate.film.looks import LIGHT, Look
from kinemimic.evaluate.film.solids import Capsule, Color, Solid
from kinemimic.pipeline.arrays import Array

SPACING, LINE = 0.5, 0.014  # m between grid lines; width of one
REACH = 7.0  # m over which the floor fades
PATCH, RESOLUTION = 4.8, 0.012  # m: side of the square that has shadows, and of its pixels
# Of the two layers of a shadow, near and far from the ground: standard deviation of the blur, m; darkness.
BLUR, DARKNESS = (0.015, 0.07), (0.55, 0.75)
HEIGHT = 0.25  # m: solids above cast the far layer only


def draw_floor(camera: Camera, look: Look, shadow_of: Sequence[Solid], around: Array) -> Floats:
    """Background and floor (height, width, 3), 0 to 1.

    shadow_of: solids on which the light falls; around: (2,) m, the point of the floor below the figure.
    """
    width, height = camera.size
    rows = np.arange(height, dtype=np.float32) + 0.5 - 0.5 * height
    columns = np.arange(width, dtype=np.float32) + 0.5 - 0.5 * width
    ramp = np.linspace(0.0, 1.0, height, dtype=np.float32)[:, None, None]
    sky = _float(look.sky[0]) * (1 - ramp) + _float(look.sky[1]) * ramp
    picture = np.broadcast_to(sky, (height, width, 3)).astype(np.float32)
    # The camera has no roll, so a row of the picture lies at one distance ahead.
    _, down, forward = camera.axes
    fall = -(forward[2] * camera.focal + down[2] * rows)
    below = int(np.searchsorted(fall, 0.02 * camera.focal))  # the horizon's row
    if below >= height:
        return picture
    scale = (camera.position[2] / fall[below:]).astype(np.float32)[:, None]
    rows = rows[below:, None]
    ahead = scale * np.float32(np.hypot(*(forward[:2])) * camera.focal) - scale * rows * np.float32(
        np.sin(camera.pitch)
    )
    aside = scale * columns
    c, s = np.float32(np.cos(camera.yaw)), np.float32(np.sin(camera.yaw))
    x = c * ahead + s * aside + np.float32(camera.position[0])
    y = s * ahead - c * aside + np.float32(camera.position[1])
    # The floor that a pixel covers, ahead and aside.
    deep, wide = np.abs(np.gradient(ahead[:, 0]))[:, None], scale
    along_x, along_y = abs(c) * deep + abs(s) * wide, abs(s) * deep + abs(c) * wide
    cover = 1 - (1 - _lines(x, along_x)) * (1 - _lines(y, along_y))
    dx, dy = x - np.float32(around[0]), y - np.float32(around[1])
    fade = np.exp(-(dx * dx + dy * dy) / np.float32(REACH * REACH))
    shade = _shadow(camera, shadow_of, around)[below:]
    floor = _float(look.floor) + cover[..., None] * (_float(look.line) - _float(look.floor))
    floor *= (1 - shade * np.float32(look.shadow))[..., None]
    picture[below:] += fade[..., None] * (floor - picture[below:])
    return picture


def _float(color: Color) -> Floats:
    return np.array(color, np.float32)


def _lines(place: Floats, width: Floats) -> Floats:
    """Share of a pixel of a width in metres around a place that grid lines cover."""
    width = np.maximum(width, np.float32(1e-4))
    low, high = (
        (place + np.float32(sign) * width + np.float32(0.5 * LINE)) * np.float32(1 / SPACING)
        for sign in (-0.5, 0.5)
    )
    share = np.float32(LINE / SPACING)

    def total(value: Floats) -> Floats:
        """Integral of the lines from 0 to a value."""
        whole = np.floor(value)
        return np.asarray(whole * share + np.minimum(value - whole, share), np.float32)

    return np.asarray((total(high) - total(low)) * np.float32(SPACING) / width, np.float32)


def _shadow(camera: Camera, solids: Sequence[Solid], around: Array) -> Floats:
    """Darkness (height, width), 0 to 1, of the floor in the shadow of solids."""
    side = round(PATCH / RESOLUTION)
    corner = around - 0.5 * PATCH
    c, s = np.cos(camera.yaw), np.sin(camera.yaw)
    # Light turns with the camera, so that the shading stays the same.
    light = np.array([c * LIGHT[0] + s * LIGHT[1], s * LIGHT[0] - c * LIGHT[1], LIGHT[2]])
    dark = np.zeros((side, side), np.float32)
    for near, blur, darkness in zip((True, False), BLUR, DARKNESS, strict=True):
        layer = np.zeros((side, side), np.uint8)
        for solid in solids:
            points, radius = solid.extent()
            if near and points[:, 2].min() - radius > HEIGHT:
                continue
            flat = points[:, :2] - points[:, 2:] * light[:2] / light[2]
            pixels = np.clip((flat - corner) / RESOLUTION, -side, 2 * side)
            fixed = np.round(pixels * 16).astype(np.int32)
            if not isinstance(solid, Capsule):
                cv2.fillConvexPoly(layer, cv2.convexHull(fixed), 255, cv2.LINE_AA, 4)
            else:
                wide = max(round(2 * radius / RESOLUTION), 1)
                cv2.line(layer, fixed[0].tolist(), fixed[1].tolist(), 255, wide, cv2.LINE_AA, 4)
        soft = cv2.GaussianBlur(layer, (0, 0), blur / RESOLUTION)
        dark = np.maximum(dark, darkness * soft.astype(np.float32) / 255)
    corners = np.array([[0, 0], [side, 0], [side, side], [0, side]], np.float32)
    world = np.column_stack([corner + corners * RESOLUTION, np.zeros(4)])
    if (camera.to_camera(world)[:, 2] < 0.1).any():
        # A corner behind the camera has no picture; the square is large enough only for cameras farther away.
        return np.zeros(camera.size[::-1], np.float32)
    onto = cv2.getPerspectiveTransform(corners, camera.project(world).astype(np.float32))
    return np.asarray(cv2.warpPerspective(dark, onto, camera.size), np.float32)
