"""The path over the belt of a treadmill: the body moves as in the room, and the belt carries its feet back.

A belt moves along one line. So a precise recording shows in the room's axes how the body sways, and how far
it lags behind the belt; only the speed of the belt comes from the feet. By the feet alone, which roll, a
walker's steps were up to a fifth too wide, and a runner's four times.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.body_points import place
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.locomotion.path.ground_path import stride_means
from kinemimic.pipeline.locomotion.path.odometry import FootOdometry

# m (rms within a stride) across the belt. Pelves of walkers and runners sway by 6 to 25 mm; one that does not
# was put in its place, as in an animation on the spot.
MIN_SWAY = 0.002
# Radians (rms over strides) by which the line of a belt may seem to turn. In optical recordings it is 0.1 to
# 0.6 degrees; before a sensor that turns with the walker, 1.3 or more in any of 100 walks.
MAX_VEER = np.radians(1.0)
MIN_STRIDES = 4.0  # in which bones that vary must show that line
# Deviation (rms over strides) up to which a belt has one speed: by the feet, that of even belts deviates by
# 0.3 to 0.8 %.
EVEN = 0.02


def velocity_over_belt(
    positions: Array, feet: FootOdometry, phase: Array, rate: float, *, precise: bool
) -> Array | None:
    """Velocity (T, 2) m/s of the middle of the hips over a belt, in the axes of positions (T, 20, 3) with Z
    up; None if they do not show how the body moves in the room.

    phase: (T,) cycles; rate: frames per second; precise: whether the recording is accurate to a centimetre.
    """
    if not feet.weights.any() or not (precise or np.ptp(phase) > MIN_STRIDES):
        return None
    hips = place(positions, "hips")[:, :2]
    recorded = rate * np.gradient(hips, axis=0)
    slides = recorded - feet.single
    slide = np.einsum("ft,ftk->k", feet.weights, slides)
    ahead = -slide / max(float(np.linalg.norm(slide)), 1e-9)
    left = np.array([-ahead[1], ahead[0]])
    carried = feet.velocity - recorded
    if not (_moves_in_room(positions, phase, left) and _keeps_its_line(carried, phase)):
        return None
    # Feet on a belt do not slide across it: less than they seem to if the body is held in its place.
    if _rms(slides @ left, feet.weights) >= _rms(feet.single @ left, feet.weights):
        return None
    belt = _belt_speed(carried @ ahead, phase)
    return np.asarray(recorded + belt[:, None] * ahead)


def _moves_in_room(positions: Array, phase: Array, left: Array) -> bool:
    """Whether all of the pelvis sways to the left, (2,), and back; not so if one point of it was held."""
    sways = []
    for point in (place(positions, "hips"), positions[:, N["hip_center"]]):
        aside = point[:, :2] @ left
        mean, whole = stride_means(aside, phase)
        if np.isfinite(aside).all() and whole.any():
            sways.append(float(np.sqrt(np.mean((aside - mean)[whole] ** 2))))
    return bool(sways) and min(sways) > MIN_SWAY


def _keeps_its_line(carried: Array, phase: Array) -> bool:
    """Whether feet are carried, with (T, 2) m/s, in the same direction in all strides."""
    (x, whole), (y, _) = (stride_means(column, phase) for column in carried.T)
    along = (x + 1j * y)[whole]
    return bool(np.std(np.angle(along / along.mean())) < MAX_VEER)


def _belt_speed(speed: Array, phase: Array) -> Array:
    """Speed (T,) of a belt by feet that it carries with (T,) m/s."""
    mean, whole = stride_means(speed, phase)
    even = float(np.mean(mean[whole]))
    if float(np.std(mean[whole])) < EVEN * abs(even):
        return np.full(len(speed), even)
    at = np.arange(len(speed))
    return np.interp(at, at[whole], mean[whole])


def _rms(speeds: Array, weights: Array) -> float:
    return float(np.sqrt(np.sum(weights * speeds**2) / weights.sum()))
