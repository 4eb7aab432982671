"""Joint centres in metres from markers on the skin; NaN where a marker is missing.

Hips: regression from the pelvis. Knees and ankles: midway between a medial and a lateral marker, or inward
from the lateral one, or, if only clusters on the segments are seen, the centre of rotation between them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.vectors import median, perpendicular, unit

# Bell, Pedersen & Brand 1990 (J. Biomech. 23, 617-621): position of the hip centre relative to the midpoint
# of the ASIS, forward, to the side and up, as shares of the distance between the ASIS.
BELL = (-0.19, 0.36, -0.30)
# Harrington et al. 2007 (J. Biomech. 40, 595-602), from magnetic resonance images: forward, to the side and
# up from the midpoint of the ASIS, metres per metre of the pelvis' depth or width, and metres.
HARRINGTON = ((-0.24, -0.0099), (0.33, 0.0073), (-0.30, -0.0109))
# Davis et al. 1991 (Hum. Mov. Sci. 10, 575-587), as in Plug-in-Gait: the hip is this far from the ASIS, in
# shares of the leg's length and metres, at these angles (radians) in the frontal and the sagittal plane; the
# trochanter is that far behind the ASIS.
DAVIS_DISTANCE, DAVIS_DEPTH = (0.115, -0.0153), (0.1288, -0.04856)
DAVIS_ANGLES = (0.5, 0.314)
# From the centre of a 14 mm marker on the lateral side to the centre of an adult's knee (105 mm wide) and
# ankle (70 mm): half the marker plus half the joint. Assumed if the subject was not measured.
HALF_KNEE, HALF_ANKLE = 0.0595, 0.042
# Weight of the anatomical guess in a centre of rotation, relative to one frame's distance between the
# segments. A hinge leaves its centre undetermined along the axis; there the guess decides, elsewhere it
# hardly counts.
_GUESS_WEIGHT = 0.2


@dataclass(frozen=True)
class Pelvis:
    """origin: (T, 3) midpoint of the ASIS; axes: (T, 3, 3), columns forward, left, up; width between the ASIS
    and depth from their midpoint to the back, metres.

    Forward and left span the plane of the ASIS and the sacrum: the anatomical pelvis, which is tilted forward
    by about 10 degrees in most people standing upright.
    """

    origin: Array
    axes: Array
    width: float
    depth: float

    @property
    def left(self) -> Array:
        return self.axes[..., 1]

    @property
    def up(self) -> Array:
        return self.axes[..., 2]


def pelvis(asis_left: Array, asis_right: Array, back: Array, below: Array) -> Pelvis:
    """The pelvis from positions (T, 3): both ASIS, the sacrum or the midpoint of the PSIS, and a point below
    them.

    The point below distinguishes up from down: in a mirrored file the order of the axes would get it wrong.
    """
    origin = 0.5 * (asis_left + asis_right)
    left = unit(asis_left - asis_right)
    forward = unit(perpendicular(origin - back, left))
    up = np.cross(forward, left)
    height = np.sum((origin - below) * up, axis=-1)
    if median(height) < 0:
        up = -up
    widths = np.linalg.norm(asis_left - asis_right, axis=-1)
    depths = np.linalg.norm(origin - back, axis=-1)
    return Pelvis(origin, np.stack([forward, left, up], axis=-1), median(widths), median(depths))


def hip_centre(
    pelvis: Pelvis, side: str, regression: str = "bell", *, leg: float = np.nan, marker: float = 0.007
) -> Array:
    """Hip centre (T, 3) by a regression: "bell", "harrington" or "davis"; side: "left" or "right".

    leg: length of the leg from the ASIS over the knee to the ankle, marker: radius of a marker, metres, both
    for "davis" only.
    """
    if regression == "harrington":
        sizes = (pelvis.depth, pelvis.width, pelvis.width)
        forward, sideways, up = (
            share * size + more for (share, more), size in zip(HARRINGTON, sizes, strict=True)
        )
    elif regression == "davis":
        distance, behind = (share * leg + more for share, more in (DAVIS_DISTANCE, DAVIS_DEPTH))
        (sine, cosine), (low, flat) = ((np.sin(angle), np.cos(angle)) for angle in DAVIS_ANGLES)
        forward = distance * cosine * low - (behind + marker) * flat
        sideways = 0.5 * pelvis.width - distance * sine
        up = -distance * cosine * flat - (behind + marker) * low
    else:
        forward, sideways, up = (pelvis.width * share for share in BELL)
    offset = np.array([forward, sideways if side == "left" else -sideways, up])
    return np.asarray(pelvis.origin + pelvis.axes @ offset)


def inward(lateral: Array, proximal: Array, medial: Array, half: float) -> Array:
    """Centre (T, 3) at `half` metres from a lateral marker, where the segment from `proximal` meets the
    joint's axis at a right angle (the chord function of Plug-in-Gait: Kadaba et al. 1990, J. Orthop. Res. 8,
    383-392).

    proximal: (T, 3) the next joint centre above; medial: (T, 3) a direction inward along the axis, of which
    only the part perpendicular to the segment counts.
    """
    to_proximal = proximal - lateral
    length = np.linalg.norm(to_proximal, axis=-1, keepdims=True)
    along = unit(to_proximal)
    inward = unit(perpendicular(medial, along))
    sine = np.minimum(half / np.where(length > 0, length, np.nan), 1.0)
    return np.asarray(lateral + half * (np.sqrt(1.0 - sine**2) * inward + sine * along))


def centre_of_rotation(above: Array, below: Array, guess: Array) -> Array:
    """The point (T, 3) that moves with both of two clusters of three markers (T, 3, 3).

    The symmetrical estimate of Ehrig et al. 2006 (J. Biomech. 39, 2798-2809): points a and b, fixed in the
    two segments, that are closest over all frames, here with a weak pull to the guess (T, 3). One estimate
    for the whole recording: the more the joint bends, the better. NaN where a marker is missing.
    """
    (rotation_a, centre_a), (rotation_b, centre_b) = _frames(above), _frames(below)
    complete = np.isfinite(rotation_a + rotation_b).all(axis=(1, 2)) & np.isfinite(guess).all(axis=-1)
    frames = int(complete.sum())
    if not frames:
        return np.full_like(guess, np.nan)
    ra, rb = rotation_a[complete].transpose(0, 2, 1), rotation_b[complete].transpose(0, 2, 1)
    separation = (centre_b - centre_a)[complete]
    weight = _GUESS_WEIGHT**2
    normal = np.eye(6) * frames * (1.0 + weight)
    normal[:3, 3:] = -np.einsum("tij,tkj->ik", ra, rb)
    normal[3:, :3] = normal[:3, 3:].T
    rhs = np.concatenate(
        [
            np.einsum("tij,tj->i", ra, separation + weight * (guess - centre_a)[complete]),
            np.einsum("tij,tj->i", rb, -separation + weight * (guess - centre_b)[complete]),
        ]
    )
    offset = np.linalg.solve(normal, rhs)
    return np.asarray(0.5 * (centre_a + rotation_a @ offset[:3] + centre_b + rotation_b @ offset[3:]))


def _frames(cluster: Array) -> tuple[Array, Array]:
    """Axes (T, 3, 3) in columns, and centroids (T, 3), of clusters of three markers (T, 3, 3)."""
    first = unit(cluster[:, 1] - cluster[:, 0])
    third = unit(np.cross(first, cluster[:, 2] - cluster[:, 0]))
    return np.stack([first, np.cross(third, first), third], axis=-1), cluster.mean(axis=1)
