"""Is every joint of a frame on valid depth? The completeness check of the paper's Fig. 3."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.skeleton import INFERRED, MISSING, TRACKED
from kinemimic.pipeline.readers.depth.camera import Camera
from kinemimic.pipeline.readers.depth.frames import Depth
from kinemimic.pipeline.readers.depth.holes import EDGE, fill

# A joint is looked at through 5 x 5 pixels: 3 cm at 3 m, as wide as a wrist.
HALF_WINDOW = 2
# So much of the window must have a reading: then a joint on the dead side of a straight edge is missing, and
# one on the live side is not.
ENOUGH = 0.5
# A joint lies inside the body, behind the skin that the camera sees: by so much at most (metres), and before
# it by no more than noise.
BEHIND, BEFORE = 0.30, 0.05
# Nothing of a body is further in depth from the middle of its joints than a leg or an arm can reach.
REACH = 1.2


class Verdict(IntEnum):
    """What was found at a joint's pixel; the word for it is in WORDS."""

    SEEN = 0
    FILLED = 1
    EDGE = 2
    DISAGREES = 3
    ABSENT = 4
    OUTSIDE = 5
    NO_DEPTH = 6
    BACKGROUND = 7


WORDS: dict[Verdict, str] = {
    Verdict.SEEN: "on valid depth",
    Verdict.FILLED: "in a small hole that was filled",
    Verdict.EDGE: "at an edge of depth",
    Verdict.DISAGREES: "depth given is not the image's",
    Verdict.ABSENT: "not given",
    Verdict.OUTSIDE: "outside the image",
    Verdict.NO_DEPTH: "without depth",
    Verdict.BACKGROUND: "on the background",
}
STATES: NDArray[np.uint8] = np.array(
    [TRACKED, INFERRED, INFERRED, INFERRED, MISSING, MISSING, MISSING, MISSING], dtype=np.uint8
)


@dataclass(frozen=True)
class Check:
    """verdicts: (J,) of Verdict; depth: (J,) metres, as given or else of the image, NaN where missing."""

    verdicts: NDArray[np.uint8]
    depth: Array

    @property
    def states(self) -> NDArray[np.uint8]:
        """(J,) 0 missing, 1 inferred, 2 tracked."""
        states: NDArray[np.uint8] = STATES[self.verdicts]
        return states

    @property
    def complete(self) -> bool:
        """Whether no joint is missing."""
        return bool((self.states != MISSING).all())


def check(image: Depth, camera: Camera, pixels: Array, given: Array) -> Check:
    """Look at every joint of one frame.

    image: (H, W) metres, 0 without a reading; pixels: (J, 2) u, v, NaN where not given; given: (J,) metres,
    the tracker's own depth, NaN where it has none: then the depth is the median of the joint's window, of its
    nearer part where that lies on an edge (a person stands before the background).
    """
    there = np.isfinite(pixels).all(axis=-1)
    inside = camera.inside(pixels)
    looked = np.flatnonzero(inside)
    verdicts = np.where(there, Verdict.OUTSIDE, Verdict.ABSENT).astype(np.uint8)
    depth = np.full(len(pixels), np.nan)
    centres = np.rint(pixels[looked]).astype(np.intp)
    raw = _windows(image, centres)
    least = ENOUGH * raw.shape[1]
    enough = (raw > 0).sum(axis=1) >= least
    values = raw
    if not (raw > 0).all():
        values = _windows(fill(image), centres)
    readable = (values > 0).sum(axis=1) >= least
    surface, edge = _surface(values[readable])
    own = given[looked[readable]]
    behind = own - surface
    found = np.select(
        [~enough[readable], edge, (behind < -BEFORE) | (behind > BEHIND)],
        [Verdict.FILLED, Verdict.EDGE, Verdict.DISAGREES],
        Verdict.SEEN,
    )
    known = np.isfinite(own)
    reached = np.where(known, own, surface)
    if len(reached):
        far = ~known & (np.abs(reached - np.median(reached)) > REACH)
        found, reached = np.where(far, Verdict.BACKGROUND, found), np.where(far, np.nan, reached)
    verdicts[looked] = Verdict.NO_DEPTH
    verdicts[looked[readable]] = found
    depth[looked[readable]] = reached
    return Check(verdicts, depth)


def _windows(image: Depth, centres: NDArray[np.intp]) -> Depth:
    """The pixels (N, 25) around centres (N, 2); those outside the image have no reading."""
    h = HALF_WINDOW
    steps = np.arange(-h, h + 1)
    rows = centres[:, 1, None, None] + steps[:, None]
    columns = centres[:, 0, None, None] + steps
    beyond = (rows < 0) | (rows >= image.shape[0]) | (columns < 0) | (columns >= image.shape[1])
    values = image[np.clip(rows, 0, image.shape[0] - 1), np.clip(columns, 0, image.shape[1] - 1)]
    return np.where(beyond, np.float32(0), values).reshape(len(centres), steps.size**2)


def _surface(values: Depth) -> tuple[Array, Mask]:
    """Depth (N,) of the nearest surface in windows (N, 25), none of them empty, and where two are in one."""
    if not len(values):
        return np.empty(0), np.empty(0, dtype=np.bool_)
    readings = np.where(values > 0, values, np.nan).astype(np.float64)
    near, far = np.nanmin(readings, axis=1), np.nanmax(readings, axis=1)
    edge = far - near > EDGE
    beyond = edge[:, None] & (readings > 0.5 * (near + far)[:, None])
    return np.asarray(np.nanmedian(np.where(beyond, np.nan, readings), axis=1)), edge
