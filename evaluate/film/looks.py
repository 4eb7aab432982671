"""Colours and light of the pictures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinemimic.evaluate.film.figures import COLORS, REFERENCE, SIMULATED
from kinemimic.evaluate.film.solids import Color
from kinemimic.pipeline.arrays import Array

# Unit vector towards the light: ahead, to the right and up, as seen by the camera.
LIGHT: Array = np.array([-0.62, -0.50, 0.60]) / np.linalg.norm([-0.62, -0.50, 0.60])


def _color(red: int, green: int, blue: int) -> Color:
    return red / 255, green / 255, blue / 255


@dataclass(frozen=True)
class Look:
    """Colours of a picture, and its light.

    sky: at the top and at the bottom; line: of the grid; alert: of text about a fall; shadow: the share of
    light that the darkest shadow takes; ambient: light from everywhere.
    """

    sky: tuple[Color, Color]
    floor: Color
    line: Color
    text: Color
    alert: Color
    shadow: float
    ambient: float


LOOKS = {
    "light": Look(
        sky=(_color(250, 251, 252), _color(234, 238, 243)),
        floor=_color(240, 243, 246),
        line=_color(205, 212, 221),
        text=_color(51, 60, 72),
        alert=_color(205, 40, 45),
        shadow=0.62,
        ambient=0.60,
    ),
    "dark": Look(
        sky=(_color(17, 20, 26), _color(30, 35, 44)),
        floor=_color(38, 44, 54),
        line=_color(66, 75, 89),
        text=_color(222, 228, 236),
        alert=_color(255, 105, 105),
        shadow=0.75,
        ambient=0.50,
    ),
}
FIGURE = _color(*COLORS[SIMULATED])
GHOST = _color(*COLORS[REFERENCE])
FALLEN = _color(150, 150, 152)  # of the simulated figure after a fall
