"""How far predicted knees and hips are from those that came."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.retarget.humanoid.motion import joint_angles
from kinemimic.retarget.library.motion_library import MotionLibrary
from kinemimic.train.prediction.fit import NOISY_NOW, NOW, windows
from kinemimic.train.prediction.noise import with_sensor_noise
from kinemimic.train.prediction.predictor import Predictor
from kinemimic.train.sim.world import CONTROL_RATE

AFTER = (1, 3, 6, 12)  # frames after the newest
MOMENTS = 2000

# Seconds ahead -> joint -> degrees.
Errors = Mapping[str, Mapping[str, float]]


def accuracy(
    predictor: Predictor, library: MotionLibrary, motions: NDArray[np.intp], seed: int
) -> dict[str, Errors]:
    """RMSE of knees and hips in degrees, on moments of these motions (M,), after AFTER frames.

    "predicted", and two controls: "held", the newest pose goes on; "steady", its joints keep their speed.
    Through the noise of a sensor, at other moments, and for the newest frame too: "denoised", and the control
    "noisy", the newest pose as captured goes on.
    """
    found: dict[str, list[Array]] = {name: [] for name in ("predicted", "held", "steady")}
    random = np.random.default_rng(seed)
    for root, rotations in windows(library, motions, MOMENTS, random):
        angles = _knees_and_hips(rotations)
        newest, coming = angles[:, NOW - 1 : NOW], angles[:, NOW - 1 :]
        ahead = np.arange(coming.shape[1])[:, None, None]
        predicted = np.array(
            [predictor.continued(*one)[1] for one in zip(root[:, :NOW], rotations[:, :NOW], strict=True)]
        )
        found["predicted"].append(_knees_and_hips(predicted) - coming)
        found["held"].append(newest - coming)
        found["steady"].append(newest + ahead * (newest - angles[:, NOW - 2 : NOW - 1]) - coming)
    found |= {"denoised": [], "noisy": []}
    for root, rotations in windows(library, motions, MOMENTS, random, NOISY_NOW):
        coming = _knees_and_hips(rotations[:, NOISY_NOW - 1 :])
        captured = with_sensor_noise(root[:, :NOISY_NOW], rotations[:, :NOISY_NOW], random)
        denoised = np.array([predictor.denoised(*one)[1] for one in zip(*captured, strict=True)])
        found["denoised"].append(_knees_and_hips(denoised) - coming)
        found["noisy"].append(_knees_and_hips(captured[1][:, -1:]) - coming)
    through_noise = ("denoised", "noisy")
    return {
        name: _by_time(np.concatenate(errors), (0, *AFTER) if name in through_noise else AFTER)
        for name, errors in found.items()
    }


def _knees_and_hips(rotations: Array) -> Array:
    """Angles (..., 2 joints, 2 sides) of rotations (..., 20, 4), rad."""
    curves = joint_angles(rotations)
    pairs = [[curves[f"{joint}_{side}"] for side in SIDES] for joint in ("knee", "hip")]
    return np.moveaxis(np.array(pairs), (0, 1), (-2, -1))


def _by_time(errors: Array, after: Sequence[int]) -> Errors:
    """RMSE in degrees, by seconds ahead, of errors (N, 1 + FUTURE, 2, 2) in rad."""
    rms = np.degrees(np.sqrt(np.mean(errors**2, axis=(0, -1))))
    return {
        f"{frames / CONTROL_RATE:.2f}": {
            joint: round(float(rms[frames, k]), 2) for k, joint in enumerate(("knee", "hip"))
        }
        for frames in after
    }
