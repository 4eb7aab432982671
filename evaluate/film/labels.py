"""Words in a picture: which figure is which, the time, and a fall."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

import matplotlib as mpl
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from kinemimic.evaluate.film.looks import Look
from kinemimic.evaluate.film.render import Picture
from kinemimic.evaluate.film.solids import Color

SMALLEST, SHARE = 11, 0.028  # pixels; of the picture's height


def write_labels(
    picture: Picture, look: Look, legend: Sequence[tuple[str, Color]], time: str, *, alert: str, note: str
) -> Picture:
    """The picture with a legend and an alert at its top, a note and the time at its bottom.

    legend: name and colour of each figure; an empty alert or note takes no space.
    """
    height, width = picture.shape[:2]
    size = max(SMALLEST, round(SHARE * min(height, 0.75 * width)))
    plain, bold = _font(size, "DejaVuSans.ttf"), _font(size, "DejaVuSans-Bold.ttf")
    image = Image.fromarray(picture)
    draw = ImageDraw.Draw(image)
    margin, text = round(1.2 * size), _bytes(look.text)
    at = float(margin)
    for name, color in legend:
        box = (at, margin + 0.25 * size, at + 0.8 * size, margin + 1.05 * size)
        draw.rounded_rectangle(box, radius=0.2 * size, fill=_bytes(color))
        draw.text((at + 1.15 * size, margin), name, fill=text, font=plain)
        at += 2.2 * size + draw.textlength(name, font=plain)
    if alert:
        draw.text((margin, margin + 1.7 * size), alert, fill=_bytes(look.alert), font=bold)
    low = height - margin - 1.2 * size
    if note:
        draw.text((margin, low), note, fill=text, font=plain)
    draw.text((width - margin, low), time, fill=text, font=plain, anchor="ra")
    return np.asarray(image)


@lru_cache
def _font(size: int, name: str) -> ImageFont.FreeTypeFont:
    """matplotlib's own font, which is there wherever the figures of the reports are."""
    return ImageFont.truetype(Path(mpl.get_data_path()) / "fonts" / "ttf" / name, size)


def _bytes(color: Color) -> tuple[int, int, int]:
    red, green, blue = (round(255 * share) for share in color)
    return red, green, blue
