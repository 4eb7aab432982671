"""Where a body faces, frame by frame, from its pose alone.

In walking and running the ankles part along the direction in which the body faces, and a depth sensor sees
that line far better than the line of the hips, whose yaw it misses by 15 to 43 degrees in an oblique view. A
line has no sign: knees bend forward and toes point forward, so they give it. The path of the hips is not
used. On a treadmill, in front of a camera that turns with the walker, or where the walker turns round, it is
not the direction in which the body faces.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.rotations import from_axis_angle, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import SIDES

# Seconds (standard deviation of a Gaussian) over which the line of the ankles and the front are averaged: a
# stride cancels what the pelvis and the noise of one frame do.
LINE_TIME, FRONT_TIME = 0.5, 0.4
# Weight of the square of the front in the line of the ankles, which vanishes for a person who stands.
_FRONT_SHARE = 0.02
# Weights of toes and of the hip and shoulder lines in the front, relative to the knees.
_TOE_SHARE, _TRUNK_SHARE = 0.5, 0.25

Complex = NDArray[np.complex128]


def body_heading(positions: Array, rate: float) -> tuple[Array, Array]:
    """Heading (T,) in radians from +X towards +Y, unwrapped, and angle (T,) in radians to the body's front.

    positions: (T, 20, 3) without gaps; rate: frames per second. The heading is the line along which the
    ankles part, in the direction where knees, toes and trunk point; so of a person who walks backward too.
    The angle is small in walking; of a person who steps sideways, the ankles part across the front.
    """
    heading, _ = _averaged_heading(positions, rate)
    # Averaging flattens a turn at either end: a second look is at what remains of it.
    ahead = rotate(from_axis_angle("Z", -heading)[:, None], positions)
    rest, angle = _averaged_heading(ahead, rate)
    return heading + rest, angle


def trunk_heading(positions: Array, rate: float) -> Array:
    """Heading (T,) in radians, unwrapped, of a body that need not stride: across the lines of its hips and
    shoulders, of which those that are missing do not count. In a jumping jack the ankles part sideways.

    positions: (T, 20, 3); rate: frames per second.
    """
    hips, shoulders = _trunk_fronts(positions)
    return np.asarray(np.unwrap(np.angle(_smooth(hips + shoulders, FRONT_TIME * rate))))


def _averaged_heading(positions: Array, rate: float) -> tuple[Array, Array]:
    """`body_heading` from one average of the line of the ankles and of the front."""
    front = _smooth(_front(positions), FRONT_TIME * rate)
    apart = _plane(positions[:, N["ankle_right"]] - positions[:, N["ankle_left"]])
    # Without the mean, which is the width of the steps: a short step may be less long than wide.
    apart = apart - _smooth(apart, LINE_TIME * rate)
    # Squares of complex numbers: opposite directions of a line have the same square.
    line = _smooth(apart**2, LINE_TIME * rate) + _FRONT_SHARE * front**2
    axis = 0.5 * np.unwrap(np.angle(line))
    off = np.cos(np.angle(front) - axis)
    forward = off >= 0.0
    # An axis that goes on through a quick turn changes its sign: unwrapped, the heading takes half a turn.
    heading = np.unwrap(axis + np.where(forward, 0.0, np.pi))
    return np.asarray(heading), np.arccos(np.clip(np.abs(off), 0.0, 1.0))


def _front(positions: Array) -> Complex:
    """Horizontal vectors (T,) in metres to the front of the body."""
    front = np.zeros(len(positions), dtype=np.complex128)
    for side in SIDES:
        hip, knee, ankle, toe = (
            positions[:, N[f"{joint}_{side}"]] for joint in ("hip", "knee", "ankle", "foot")
        )
        leg = ankle - hip
        length = np.linalg.norm(leg, axis=-1, keepdims=True)
        leg = leg / np.where(length > 0.0, length, 1.0)
        thigh = knee - hip
        front += _plane(thigh - np.sum(thigh * leg, axis=-1, keepdims=True) * leg)
        front += _TOE_SHARE * np.nan_to_num(_plane(toe - ankle))
    for line in _trunk_fronts(positions):
        front += _TRUNK_SHARE * line
    return front


def _trunk_fronts(positions: Array) -> tuple[Complex, Complex]:
    """Horizontal vectors (T,) across the lines of hips and shoulders, 0 where one is missing."""
    hips, shoulders = (
        np.nan_to_num(-1j * _plane(positions[:, N[f"{joint}_left"]] - positions[:, N[f"{joint}_right"]]))
        for joint in ("hip", "shoulder")
    )
    return hips, shoulders


def _plane(vectors: Array) -> Complex:
    """Horizontal components of vectors (T, 3) as complex numbers (T,)."""
    return np.asarray(vectors[:, 0] + 1j * vectors[:, 1])


def _smooth(values: Complex, frames: float) -> Complex:
    real, imaginary = (gaussian_filter1d(part, frames, mode="nearest") for part in (values.real, values.imag))
    return np.asarray(real + 1j * imaginary)


def along_heading(vectors: Array, heading: Array) -> Array:
    """Vectors (T, ..., 3) in axes that turn with the heading (T,): X forward, Y left, Z up."""
    shape = (-1, *(1,) * (vectors.ndim - 2))
    cosine, sine = np.cos(heading).reshape(shape), np.sin(heading).reshape(shape)
    x, y, z = np.moveaxis(vectors, -1, 0)
    return np.stack([cosine * x + sine * y, cosine * y - sine * x, z], axis=-1)


def ankle_distance(positions: Array, seen: Mask, heading: Array) -> tuple[Array, Mask, Array]:
    """Vector (T, 3) from the left to the right ankle, (T,) whether both are seen, and its length (T,) along
    the heading, NaN where they are not.

    positions: (T, 20, 3) metres; seen: (T, 20); heading: (T,) radians.
    """
    ankles = positions[:, N["ankle_right"]] - positions[:, N["ankle_left"]]
    both = np.asarray(seen[:, [N["ankle_left"], N["ankle_right"]]].all(axis=1))
    return ankles, both, np.where(both, along_heading(ankles, heading)[:, 0], np.nan)
