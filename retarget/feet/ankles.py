"""Ankles of a walk whose feet the sensor did not see: the normative curve on this walker's shanks."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.gait.normative import FOOT_OFF, normative_band
from kinemimic.pipeline.kinematics.rotations import conjugate, from_axis_angle, multiply
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.retarget.feet.legs import foot_phases, lean_and_yaw, until_clear
from kinemimic.retarget.feet.scale import body_kinematics

# Ankles of a walk whose feet were not seen: flat in stance and neutral otherwise, or the normative curve.
AnkleMode = Literal["neutral", "normal"]
ANKLE_MODES: tuple[AnkleMode, ...] = get_args(AnkleMode)

FOOT_FLAT = (
    0.08,
    0.36,
)  # of the stride: the sole lies on the ground, from after landing until the heel leaves
_SWING_PHASE = (FOOT_OFF + 0.02, 0.96)
_BLEND = 0.08


def normal_feet(rotations: Array, phase: Array) -> Array:
    """Local rotations (T, 20, 4) of a walk with normative ankles; phases (T,) in cycles.

    A foot's stride begins where the foot is farthest ahead, at initial contact. The curve gets one offset
    that makes the sole flat in mid-stance, because a sensor knows the shank's vertical only to 5 degrees. A
    sensor's knee bends too little in swing, so the toes are lifted until the foot clears the ground.
    """
    return until_clear(lambda lifts: _with_ankles(rotations, phase, lifts), phase)


def _with_ankles(rotations: Array, phase: Array, lifts: Array) -> Array:
    out = rotations.copy()
    frames = body_kinematics(rotations)[1]
    for side, stride, lift in zip(SIDES, foot_phases(phase), lifts, strict=True):
        knee, ankle = N[f"knee_{side}"], N[f"ankle_{side}"]
        lean, yaw = lean_and_yaw(frames[:, knee])
        pitch = lean - normative_band("ankle", stride)[0]
        flat = (stride > FOOT_FLAT[0]) & (stride < FOOT_FLAT[1])
        pitch -= float(np.mean(pitch[flat])) if flat.any() else 0.0
        # A raised cosine at either end keeps the curve smooth.
        share = np.clip(np.minimum(stride - _SWING_PHASE[0], _SWING_PHASE[1] - stride) / _BLEND, 0.0, 1.0)
        pitch -= lift * 0.5 * (1.0 - np.cos(np.pi * share))
        foot = multiply(from_axis_angle("Z", yaw), from_axis_angle("Y", pitch))
        out[:, ankle] = multiply(conjugate(frames[:, knee]), foot)
    return out
