"""Checks whether every joint of a frame is on valid depth: the completeness check of the paper's Fig. 3."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.skeleton import INFERRED, MISSING, TRACKED
from kinemimic.pipeline.readers.depth.camera import Camera
from kinemimic.pipeline.readers.depth.frames import Depth
from kinemimic.pipeline.readers.depth.holes import EDGE_STEP, fill

# The window around a joint is 5 x 5 pixels: 3 cm at 3 m, as wide as a wrist.
HALF_WINDOW = 2
# Minimum share of readings in the window: a joint on the empty side of a straight depth edge is then missing,
# one on the other side is not.
MIN_READINGS = 0.5
# A joint lies inside the body, behind the skin that the camera sees: at most this far behind (metres), and in
# front of it only by noise.
MAX_BEHIND, MAX_BEFORE = 0.30, 0.05
# No part of a body is further in depth from the median joint than a leg or an arm can reach (metres).
REACH = 1.2


class DepthCheck(IntEnum):
    """The result of the check at one joint's pixel; DESCRIPTIONS has the text for each."""

    SEEN = 0
    FILLED = 1
    EDGE = 2
    DISAGREES = 3
    ABSENT = 4
    OUTSIDE = 5
    NO_DEPTH = 6
    BACKGROUND = 7


DESCRIPTIONS: dict[DepthCheck, str] = {
    DepthCheck.SEEN: "on valid depth",
    DepthCheck.FILLED: "in a small, filled hole",
    DepthCheck.EDGE: "at a depth edge",
    DepthCheck.DISAGREES: "at a depth other than the image's",
    DepthCheck.ABSENT: "not given",
    DepthCheck.OUTSIDE: "outside the image",
    DepthCheck.NO_DEPTH: "without depth",
    DepthCheck.BACKGROUND: "on the background",
}
STATE_OF_CHECK: NDArray[np.uint8] = np.array(
    [TRACKED, INFERRED, INFERRED, INFERRED, MISSING, MISSING, MISSING, MISSING], dtype=np.uint8
)


@dataclass(frozen=True)
class FrameCheck:
    """checks: (J,) of DepthCheck; depth: (J,) metres, as given or else from the image, NaN where missing."""

    checks: NDArray[np.uint8]
    depth: Array

    @property
    def states(self) -> NDArray[np.uint8]:
        """(J,) 0 missing, 1 inferred, 2 tracked."""
        states: NDArray[np.uint8] = STATE_OF_CHECK[self.checks]
        return states

    @property
    def complete(self) -> bool:
        """Whether no joint is missing."""
        return bool((self.states != MISSING).all())


def check(image: Depth, camera: Camera, pixels: Array, given: Array) -> FrameCheck:
    """Check every joint of one frame.

    image: (H, W) metres, 0 without a reading; pixels: (J, 2) u, v, NaN where not given; given: (J,) the
    tracker's own depth in metres, NaN without. Without it, the depth is the median of the joint's window, or
    of the nearer surface if the window is on a depth edge (people stand in front of the background).
    """
    given_pixels = np.isfinite(pixels).all(axis=-1)
    inside = camera.inside(pixels)
    in_image = np.flatnonzero(inside)
    checks = np.where(given_pixels, DepthCheck.OUTSIDE, DepthCheck.ABSENT).astype(np.uint8)
    depth = np.full(len(pixels), np.nan)
    centres = np.rint(pixels[in_image]).astype(np.intp)
    raw = _windows(image, centres)
    min_readings = MIN_READINGS * raw.shape[1]
    enough = (raw > 0).sum(axis=1) >= min_readings
    values = raw
    if not (raw > 0).all():
        values = _windows(fill(image), centres)
    readable = (values > 0).sum(axis=1) >= min_readings
    surface, edge = _surface(values[readable])
    given_depth = given[in_image[readable]]
    behind = given_depth - surface
    found = np.select(
        [~enough[readable], edge, (behind < -MAX_BEFORE) | (behind > MAX_BEHIND)],
        [DepthCheck.FILLED, DepthCheck.EDGE, DepthCheck.DISAGREES],
        DepthCheck.SEEN,
    )
    has_depth = np.isfinite(given_depth)
    joint_depth = np.where(has_depth, given_depth, surface)
    if len(joint_depth):
        background = ~has_depth & (np.abs(joint_depth - np.median(joint_depth)) > REACH)
        found = np.where(background, DepthCheck.BACKGROUND, found)
        joint_depth = np.where(background, np.nan, joint_depth)
    checks[in_image] = DepthCheck.NO_DEPTH
    checks[in_image[readable]] = found
    depth[in_image[readable]] = joint_depth
    return FrameCheck(checks, depth)


def _windows(image: Depth, centres: NDArray[np.intp]) -> Depth:
    """The windows (N, 25) around centres (N, 2); pixels outside the image have no reading."""
    h = HALF_WINDOW
    steps = np.arange(-h, h + 1)
    rows = centres[:, 1, None, None] + steps[:, None]
    columns = centres[:, 0, None, None] + steps
    beyond = (rows < 0) | (rows >= image.shape[0]) | (columns < 0) | (columns >= image.shape[1])
    values = image[np.clip(rows, 0, image.shape[0] - 1), np.clip(columns, 0, image.shape[1] - 1)]
    return np.where(beyond, np.float32(0), values).reshape(len(centres), steps.size**2)


def _surface(values: Depth) -> tuple[Array, Mask]:
    """Depth (N,) of the nearest surface in non-empty windows (N, 25), and whether a window holds two
    surfaces."""
    if not len(values):
        return np.empty(0), np.empty(0, dtype=np.bool_)
    readings = np.where(values > 0, values, np.nan).astype(np.float64)
    nearest, farthest = np.nanmin(readings, axis=1), np.nanmax(readings, axis=1)
    edge = farthest - nearest > EDGE_STEP
    beyond = edge[:, None] & (readings > 0.5 * (nearest + farthest)[:, None])
    return np.asarray(np.nanmedian(np.where(beyond, np.nan, readings), axis=1)), edge
