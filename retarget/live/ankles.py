"""Plausible ankles for a live capture whose sensor does not see the feet.

Offline, `feet/legs.neutral_feet` knows the phase of the stride. Here the height of an ankle above the lower
one tells a foot on the ground from one in the air.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import conjugate, from_axis_angle, multiply
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.retarget.feet.legs import STANCE_ANKLE_RANGE, SWING_TOE_LIFT, lean_and_yaw

# Metres of an ankle above the lower one between which the sole leaves the ground.
LEAVES, LEFT = 0.02, 0.10
_SMOOTHING = 0.04  # s


def with_neutral_ankles(rotations: Array, frames: Array, heights: Array, rate: float) -> Array:
    """Local rotations (T, 20, 4) with soles flat on the ground and toes lifted in the air.

    frames: (T, 20, 4) world frames of the rotations; heights: (T, 2) of the left and right ankle, metres.
    """
    out = rotations.copy()
    above = heights - heights.min(axis=1, keepdims=True)
    for k, side in enumerate(SIDES):
        knee, ankle = N[f"knee_{side}"], N[f"ankle_{side}"]
        lean, yaw = lean_and_yaw(frames[:, knee])
        loaded = np.clip((LEFT - above[:, k]) / (LEFT - LEAVES), 0.0, 1.0)
        angle = loaded * np.clip(-lean, -STANCE_ANKLE_RANGE[1], -STANCE_ANKLE_RANGE[0])
        angle -= (1.0 - loaded) * SWING_TOE_LIFT
        angle = gaussian_filter1d(angle, _SMOOTHING * rate, mode="nearest")
        foot = multiply(from_axis_angle("Z", yaw), from_axis_angle("Y", lean + angle))
        out[:, ankle] = multiply(conjugate(frames[:, knee]), foot)
    return out
