"""Draw a skeleton into an image: bones as lines, joints as discs coloured by state, and a caption."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.skeleton import BONES, INFERRED, MISSING, NODE_INDEX, TRACKED
from kinemimic.pipeline.readers.depth.frames import Depth, Image

Colour = tuple[int, int, int]

# Blue, green, red. Colours that occur neither in depth images nor in skin.
COLOURS: dict[int, Colour] = {TRACKED: (60, 230, 30), INFERRED: (20, 130, 255)}
_STATE_NAMES: dict[int, str] = {TRACKED: "tracked", INFERRED: "inferred", MISSING: "missing"}
_BONE: Colour = (255, 255, 255)
_DARK: Colour = (0, 0, 0)
_NO_DEPTH: Colour = (60, 20, 20)
_GREY_RANGE = (40, 225)
# Fixed point of OpenCV's drawing: coordinates in sixteenths of a pixel.
_SHIFT = 4


@dataclass(frozen=True)
class Sizes:
    """Radius of a disc and width of a bone in pixels, and font scale of the caption."""

    radius: float
    line: int
    text: float

    @classmethod
    def of(cls, width: int) -> Sizes:
        """Sizes for an image of that width."""
        return cls(max(3.0, width / 140.0), max(1, round(width / 400)), max(0.35, width / 1200.0))


def shaded(depth: Depth, near: float, far: float) -> Image:
    """A depth image (H, W) in metres as grey levels, near light and far dark; blue where depth is missing."""
    dark, light = _GREY_RANGE
    share = np.clip((depth - near) / max(far - near, 1e-3), 0.0, 1.0)
    grey = np.rint(light - share * (light - dark)).astype(np.uint8)
    image: Image = np.repeat(grey[..., None], 3, axis=-1)
    image[depth == 0] = _NO_DEPTH
    return image


def draw_skeleton(image: Image, pixels: Array, states: NDArray[np.uint8]) -> None:
    """Draw the 20 nodes at pixels (20, 2) with states (20,) into an image (H, W, 3), in place.

    Missing nodes (state 0 or NaN) and their bones are not drawn.
    """
    sizes = Sizes.of(image.shape[1])
    shown = np.isfinite(pixels).all(axis=-1) & np.isin(states, list(COLOURS))
    for width, colour in ((sizes.line + 2, _DARK), (sizes.line, _BONE)):
        for start, end in BONES:
            a, b = NODE_INDEX[start], NODE_INDEX[end]
            if shown[a] and shown[b]:
                cv2.line(image, _fixed(pixels[a]), _fixed(pixels[b]), colour, width, cv2.LINE_AA, _SHIFT)
    # Tracked joints last, so that they cover inferred ones.
    for joint in sorted(np.flatnonzero(shown), key=lambda j: int(states[j])):
        for radius, colour in ((sizes.radius + 1.5, _DARK), (sizes.radius, COLOURS[int(states[joint])])):
            reach = round(radius * 2**_SHIFT)
            cv2.circle(image, _fixed(pixels[joint]), reach, colour, cv2.FILLED, cv2.LINE_AA, _SHIFT)


def draw_caption(image: Image, text: str, states: NDArray[np.uint8]) -> None:
    """Write a line at the top of an image, in place: the text, then the number of joints in each state."""
    sizes = Sizes.of(image.shape[1])
    font, margin = cv2.FONT_HERSHEY_SIMPLEX, round(14 * sizes.text)
    height = cv2.getTextSize("0", font, sizes.text, 1)[0][1]
    bar = image[: height + 2 * margin]
    bar[:] = bar // 3
    place = margin
    counts = {state: int((states == state).sum()) for state in _STATE_NAMES}
    parts = [(text, _BONE)]
    parts += [(f"{counts[state]} {word}", COLOURS.get(state, _BONE)) for state, word in _STATE_NAMES.items()]
    for part, colour in parts:
        cv2.putText(image, part, (place, margin + height), font, sizes.text, colour, 1, cv2.LINE_AA)
        place += cv2.getTextSize(part, font, sizes.text, 1)[0][0] + 2 * margin


def _fixed(pixel: Array) -> tuple[int, int]:
    # OpenCV takes 32-bit coordinates; clipped points lie far outside the image.
    u, v = (round(float(x)) for x in np.clip(pixel, -1e4, 1e5) * 2**_SHIFT)
    return u, v
