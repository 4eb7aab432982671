"""Noise like a depth sensor's, on motions that have none: what the denoising network learns to remove.

A live capture has been filtered, so that its noise wanders, for a tenth of a second and longer. Joints are
off by degrees, knees never bend backward, the trunk is often not measured at all but takes the neutral pose
of `retarget`, arms are guesses, and the path hesitates and hurries.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import (
    IDENTITY,
    from_axis_angle,
    from_rotvec,
    multiply,
    rotate,
    to_rotvec,
)
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.train.prediction.moments import heading
from kinemimic.train.sim.world import CONTROL_RATE

STRENGTH = (0.6, 2.5)  # factor on what wanders, and at most 1 on what stays
# Standard deviations about X, Y, Z in degrees: of what wanders, and of what stays.
WANDERS = {
    "hip_center": (1.5, 1.5, 4.0),
    "spine": (2.0, 2.0, 2.0),
    "shoulder_center": (2.0, 2.0, 2.0),
    "hip": (4.0, 5.0, 2.5),
    "knee": (0.0, 7.0, 0.0),
    "ankle": (3.0, 8.0, 3.0),
    "shoulder": (20.0, 20.0, 25.0),
    "elbow": (5.0, 25.0, 5.0),
    "wrist": (5.0, 5.0, 5.0),
}
STAYS = {
    "hip_center": (1.0, 3.0, 1.0),
    "spine": (1.0, 2.0, 1.0),
    "shoulder_center": (1.0, 2.0, 1.0),
    "hip": (3.0, 4.0, 2.0),
    "knee": (0.0, 6.0, 0.0),
    "ankle": (3.0, 8.0, 4.0),
    "shoulder": (15.0, 15.0, 30.0),
    "elbow": (5.0, 15.0, 5.0),
    "wrist": (3.0, 3.0, 3.0),
}
NEUTRAL = 0.6  # share of the captures whose trunk is neutral
LEAN = (0.03, 0.06)  # rad: mean and standard deviation of a neutral trunk's
# Standard deviations ahead, to the side and up: m/s of the path, and m of the height.
PATH_WANDERS, PATH_STAYS, HEIGHT = (0.30, 0.15), (0.12, 0.05), 0.008
# s: standard deviation of the Gaussian that smooths what wanders, drawn evenly in its logarithm.
JOINT_TIMES, PATH_TIMES = (0.04, 0.25), (0.06, 0.30)
_GROUPS = 6  # of captures, with a time for each


def with_sensor_noise(root: Array, rotations: Array, random: np.random.Generator) -> tuple[Array, Array]:
    """Noisy copies of motions at the control rate: root (N, F, 3) m, rotations (N, F, 20, 4) local."""
    count, frames = root.shape[:2]
    strength = random.uniform(*STRENGTH, (count, 1, 1))
    constant = np.minimum(strength, 1.0)

    def errors(wanders: tuple[float, ...], stays: tuple[float, ...], times: tuple[float, float]) -> Array:
        wandering = _smooth_noise(count, frames, len(wanders), times, random)
        staying = random.standard_normal((count, 1, len(stays)))
        total: Array = strength * wanders * wandering + constant * stays * staying
        return total

    noisy = rotations.copy()
    for name, node in NODE_INDEX.items():
        joint = name.removesuffix("_left").removesuffix("_right")
        if joint not in WANDERS:
            continue
        error = np.radians(errors(WANDERS[joint], STAYS[joint], JOINT_TIMES))
        if name == "hip_center":
            turn = from_rotvec(error * [0.0, 0.0, 1.0])
            noisy[:, :, node] = multiply(
                turn, multiply(noisy[:, :, node], from_rotvec(error * [1.0, 1.0, 0.0]))
            )
        elif joint == "knee":
            bend = to_rotvec(noisy[:, :, node]) + error
            bend[..., 1] = np.maximum(bend[..., 1], 0.0)
            noisy[:, :, node] = from_rotvec(bend)
        else:
            noisy[:, :, node] = multiply(noisy[:, :, node], from_rotvec(error))
    neutral = np.flatnonzero(random.random(count) < NEUTRAL)
    lean = np.broadcast_to(random.normal(*LEAN, (len(neutral), 1)), (len(neutral), frames))
    pelvis = NODE_INDEX["hip_center"]
    noisy[neutral, :, pelvis] = multiply(heading(noisy[neutral, :, pelvis]), from_axis_angle("Y", lean))
    for name in ("spine", "shoulder_center"):
        noisy[neutral, :, NODE_INDEX[name]] = IDENTITY
    along = np.zeros((count, frames, 3))
    along[..., :2] = errors(PATH_WANDERS, PATH_STAYS, PATH_TIMES)
    path = np.cumsum(rotate(heading(rotations[:, :, pelvis]), along), axis=1) / CONTROL_RATE
    path[..., 2] = errors((HEIGHT,), (0.0,), JOINT_TIMES)[..., 0]
    return root + path, noisy


def _smooth_noise(
    count: int, frames: int, columns: int, times: tuple[float, float], random: np.random.Generator
) -> Array:
    """Noise (count, frames, columns) of unit variance, smoothed over times in seconds."""
    out = np.empty((count, frames, columns))
    widths = CONTROL_RATE * np.exp(random.uniform(np.log(times[0]), np.log(times[1]), _GROUPS))
    for width, rows in zip(widths, np.array_split(random.permutation(count), _GROUPS), strict=True):
        margin = int(3.0 * width) + 1
        apart = np.arange(frames)[:, None] - np.arange(-margin, frames + margin)
        kernel = np.exp(-0.5 * (apart / width) ** 2)
        kernel /= np.linalg.norm(kernel, axis=1, keepdims=True)
        white = random.standard_normal((len(rows), frames + 2 * margin, columns))
        out[rows] = kernel @ white
    return out
