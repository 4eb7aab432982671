"""Centres of joints from the markers on the skin, in metres; NaN wherever a marker is missing.

Hips: regression from the pelvis. Knees and ankles: between a medial and a lateral marker, or inward of the
lateral one, or, where only clusters of markers on the segments are seen, the point about which they turn.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinemimic.pipeline.arrays import Array

# Bell, Pedersen & Brand 1990 (J. Biomech. 23, 617-621): the hip centre lies, in shares of the distance
# between the ASIS and from their midpoint, so far forward, to the side and up.
BELL = (-0.19, 0.36, -0.30)
# From the middle of a marker of 14 mm on the lateral side to the centre of an adult's knee of 105 mm and
# ankle of 70 mm: half of the marker and half of the joint. An assumption where nobody measured the subject.
HALF_KNEE, HALF_ANKLE = 0.0595, 0.042
# How much, against one frame's closeness of the two segments, a centre of rotation is drawn to the
# anatomical guess. A hinge leaves its centre free along the axis; there the guess decides, elsewhere hardly.
_GUESS_WEIGHT = 0.2


@dataclass(frozen=True)
class Pelvis:
    """origin: (T, 3) midpoint of the ASIS; axes: (T, 3, 3), columns forward, left, up; width: metres.

    Forward and left span the plane of the ASIS and the sacrum: the anatomical pelvis, which in most people
    who stand upright is tilted forward by about 10 degrees.
    """

    origin: Array
    axes: Array
    width: float

    @property
    def left(self) -> Array:
        return self.axes[..., 1]

    @property
    def up(self) -> Array:
        return self.axes[..., 2]


def pelvis(asis_left: Array, asis_right: Array, back: Array, below: Array) -> Pelvis:
    """The pelvis from places (T, 3): both ASIS, the sacrum or the midpoint of the PSIS, and one below them.

    What is below it tells up from down: in a mirrored file the order of the axes would tell it wrongly.
    """
    origin = 0.5 * (asis_left + asis_right)
    left = unit(asis_left - asis_right)
    forward = unit(_across(origin - back, left))
    up = np.cross(forward, left)
    height = np.sum((origin - below) * up, axis=-1)
    if _median(height) < 0:
        up = -up
    widths = np.linalg.norm(asis_left - asis_right, axis=-1)
    return Pelvis(origin, np.stack([forward, left, up], axis=-1), _median(widths))


def hip_centre(pelvis: Pelvis, side: str) -> Array:
    """(T, 3) after Bell et al. 1990; side: "left" or "right"."""
    forward, aside, up = (pelvis.width * share for share in BELL)
    place = np.array([forward, aside if side == "left" else -aside, up])
    return np.asarray(pelvis.origin + pelvis.axes @ place)


def inward(lateral: Array, proximal: Array, medial: Array, half: float) -> Array:
    """Centre (T, 3) at `half` metres from a lateral marker, where the segment from `proximal` meets the
    joint's axis at a right angle (the chord of Plug-in-Gait: Kadaba et al. 1990, J. Orthop. Res. 8, 383-392).

    proximal: (T, 3) the centre of the joint above; medial: (T, 3) a direction inward along the axis, of which
    only the part across the segment counts.
    """
    reach = proximal - lateral
    length = np.linalg.norm(reach, axis=-1, keepdims=True)
    along = unit(reach)
    across = unit(_across(medial, along))
    sine = np.minimum(half / np.where(length > 0, length, np.nan), 1.0)
    return np.asarray(lateral + half * (np.sqrt(1.0 - sine**2) * across + sine * along))


def centre_of_rotation(above: Array, below: Array, guess: Array) -> Array:
    """The point (T, 3) that moves with both of two clusters of three markers (T, 3, 3).

    The symmetrical estimate of Ehrig et al. 2006 (J. Biomech. 39, 2798-2809): places a and b, fixed in the
    two segments, that are nearest to one another over all frames, here with a weak pull to the guess (T, 3).
    It is for the whole recording: the more the joint bends in it, the better. NaN where a marker is missing.
    """
    (turn_a, at_a), (turn_b, at_b) = _frames(above), _frames(below)
    whole = np.isfinite(turn_a + turn_b).all(axis=(1, 2)) & np.isfinite(guess).all(axis=-1)
    frames = int(whole.sum())
    if not frames:
        return np.full_like(guess, np.nan)
    ra, rb = turn_a[whole].transpose(0, 2, 1), turn_b[whole].transpose(0, 2, 1)
    apart = (at_b - at_a)[whole]
    pull = _GUESS_WEIGHT**2
    normal = np.eye(6) * frames * (1.0 + pull)
    normal[:3, 3:] = -np.einsum("tij,tkj->ik", ra, rb)
    normal[3:, :3] = normal[:3, 3:].T
    right = np.concatenate(
        [
            np.einsum("tij,tj->i", ra, apart + pull * (guess - at_a)[whole]),
            np.einsum("tij,tj->i", rb, -apart + pull * (guess - at_b)[whole]),
        ]
    )
    place = np.linalg.solve(normal, right)
    return np.asarray(0.5 * (at_a + turn_a @ place[:3] + at_b + turn_b @ place[3:]))


def unit(vectors: Array) -> Array:
    """Vectors (..., 3) of length 1; NaN where there is no direction."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(length > 0, length, np.nan))


def _across(vectors: Array, axis: Array) -> Array:
    """The part of the vectors at right angles to a unit axis."""
    return np.asarray(vectors - np.sum(vectors * axis, axis=-1, keepdims=True) * axis)


def _median(values: Array) -> float:
    """Of those that are there; NaN of none."""
    seen = values[np.isfinite(values)]
    return float(np.median(seen)) if len(seen) else np.nan


def _frames(cluster: Array) -> tuple[Array, Array]:
    """Axes (T, 3, 3) in columns, and middles (T, 3), of clusters of three markers (T, 3, 3)."""
    first = unit(cluster[:, 1] - cluster[:, 0])
    third = unit(np.cross(first, cluster[:, 2] - cluster[:, 0]))
    return np.stack([first, np.cross(third, first), third], axis=-1), cluster.mean(axis=1)
