"""Legs as legs are, for recordings that do not show it: knees that do not bend forward, and feet."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.gait import fourier
from kinemimic.pipeline.kinematics.rotations import conjugate, from_axis_angle, multiply, rotate, to_rotvec
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.retarget.feet.scale import body_kinematics
from kinemimic.retarget.humanoid.body import LEG_LENGTH, node_offsets

STANCE_ANKLE_RANGE = (-np.radians(25.0), np.radians(20.0))  # ankle: toes down, toes up
# Of a foot that bears weight: the shank turns over it before the heel comes up (limits.py has the ends).
LOADED_ANKLE_RANGE = (-np.radians(40.0), np.radians(45.0))
SWING_TOE_LIFT = np.radians(10.0)  # toes up while the foot swings past, as people do it
SHANK_LENGTH = float(-node_offsets()[N["ankle_left"], 2])


def limit_knee_extension(rotations: Array, least: float = 0.0, softness: float = np.radians(3.0)) -> Array:
    """Local rotations (T, 20, 4) whose knees flex by at least about `least` radians, the hips compensating.

    A sensor puts the knee of a straight leg some centimetres behind it. The line from hip to ankle is kept:
    what the knee gains, the thigh leans forward in proportion, and the foot stays as it stands.
    """
    out = rotations.copy()
    for side in ("left", "right"):
        hip, knee, ankle = (N[f"{joint}_{side}"] for joint in ("hip", "knee", "ankle"))
        angle = to_rotvec(rotations[:, knee])[:, 1]
        # A smooth maximum, so that the curve has no corner.
        gain = softness * np.logaddexp(0.0, (least - angle) / softness)
        thigh = gain * SHANK_LENGTH / LEG_LENGTH
        out[:, hip] = multiply(rotations[:, hip], from_axis_angle("Y", -thigh))
        out[:, knee] = from_axis_angle("Y", angle + gain)
        out[:, ankle] = multiply(from_axis_angle("Y", thigh - gain), rotations[:, ankle])
    return out


def neutral_feet(rotations: Array, phase: Array) -> Array:
    """Local rotations (T, 20, 4) with made-up ankles, phases (T,) in cycles.

    In the middle of stance the sole stays flat on the ground and the shank turns over it; towards landing and
    toe-off the ankle returns to the one angle that is flat on average; in swing it lifts the toes.
    """
    out = rotations.copy()
    frames = body_kinematics(rotations)[1]
    for side, shift in (("left", 0.0), ("right", 0.5)):
        knee, ankle = N[f"knee_{side}"], N[f"ankle_{side}"]
        lean, yaw = lean_and_yaw(frames[:, knee])
        stance = np.mod(phase + shift, 1.0)
        # Flat from when the heel has come down until it leaves: 10 to 36 % of the stride.
        weight = np.clip(np.minimum(stance / 0.10, (0.50 - stance) / 0.14), 0.0, 1.0)
        middle = (stance > 0.08) & (stance < 0.38)
        usual = -float(np.mean(lean[middle]))
        angle = usual + weight * (np.clip(-lean, -STANCE_ANKLE_RANGE[1], -STANCE_ANKLE_RANGE[0]) - usual)
        angle -= SWING_TOE_LIFT * np.clip(
            np.minimum((stance - 0.58) / 0.10, (0.95 - stance) / 0.10), 0.0, 1.0
        )
        angle = fourier.evaluate(fourier.fit(phase, angle, 5), phase)
        foot = multiply(from_axis_angle("Z", yaw), from_axis_angle("Y", lean + angle))
        out[:, ankle] = multiply(conjugate(frames[:, knee]), foot)
    return out


def flat_feet(rotations: Array) -> Array:
    """Local rotations (T, 20, 4) with both soles level, looking where the shank looks, as far as ankles go.

    Beyond that the heel comes up, as behind a lunge, or the toes do.
    """
    out = rotations.copy()
    frames = body_kinematics(rotations)[1]
    for side in ("left", "right"):
        knee, ankle = N[f"knee_{side}"], N[f"ankle_{side}"]
        lean, yaw = lean_and_yaw(frames[:, knee])
        pitch = lean + np.clip(-lean, *LOADED_ANKLE_RANGE)
        foot = multiply(from_axis_angle("Z", yaw), from_axis_angle("Y", pitch))
        out[:, ankle] = multiply(conjugate(frames[:, knee]), foot)
    return out


def lean_and_yaw(frames: Array) -> tuple[Array, Array]:
    """Pitch (forward positive) and heading (T,) in radians of frames (T, 4) of shanks.

    The heading comes from the lateral axis: the front of a runner's shank turns past the vertical.
    """
    lateral = rotate(frames, np.array([0.0, 1.0, 0.0]))
    yaw = np.arctan2(-lateral[:, 0], lateral[:, 1])
    forward = rotate(frames, np.array([1.0, 0.0, 0.0]))
    ahead = forward[:, 0] * np.cos(yaw) + forward[:, 1] * np.sin(yaw)
    return np.arctan2(-forward[:, 2], ahead), yaw
