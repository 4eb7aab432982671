"""Plausible knees and feet for recordings that do not show them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import conjugate, from_axis_angle, multiply, rotate, to_rotvec
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.pipeline.locomotion.phase import fourier
from kinemimic.retarget.feet.contact import sole_positions
from kinemimic.retarget.feet.scale import body_kinematics
from kinemimic.retarget.humanoid.body import LEG_LENGTH, node_offsets

STANCE_ANKLE_RANGE = (-np.radians(25.0), np.radians(20.0))  # plantarflexion, dorsiflexion
# Of a loaded foot: the shank turns over it before the heel rises (see limits.py for the ends).
LOADED_ANKLE_RANGE = (-np.radians(40.0), np.radians(45.0))
SWING_TOE_LIFT = np.radians(10.0)  # dorsiflexion in swing, as people do it
MIN_CLEARANCE = 0.015  # m between a swinging sole and the standing one
MAX_TOE_LIFT = np.radians(20.0)
FEET_ADJACENT = (0.66, 0.82)  # of the stride: the swinging foot passes the other
TOE_LENGTH = 0.12  # m from the ankle to the end of the sole
KNEE_SOFTNESS = np.radians(3.0)  # over which a knee's curve bends away from straight
SHANK_LENGTH = float(-node_offsets()[N["ankle_left"], 2])


def limit_knee_extension(rotations: Array) -> Array:
    """Local rotations (T, 20, 4) without knees that are extended beyond straight; the hips compensate.

    A sensor places the knee of a straight leg some centimetres too far back. The line from hip to ankle and
    the foot's orientation are kept: as the knee flexes, the thigh leans forward in proportion.
    """
    out = rotations.copy()
    for side in SIDES:
        hip, knee, ankle = (N[f"{joint}_{side}"] for joint in ("hip", "knee", "ankle"))
        angle = to_rotvec(rotations[:, knee])[:, 1]
        # A smooth maximum keeps the curve smooth.
        flexion = KNEE_SOFTNESS * np.logaddexp(0.0, -angle / KNEE_SOFTNESS)
        thigh = flexion * SHANK_LENGTH / LEG_LENGTH
        out[:, hip] = multiply(rotations[:, hip], from_axis_angle("Y", -thigh))
        out[:, knee] = from_axis_angle("Y", angle + flexion)
        out[:, ankle] = multiply(from_axis_angle("Y", thigh - flexion), rotations[:, ankle])
    return out


def neutral_feet(rotations: Array, phase: Array) -> Array:
    """Local rotations (T, 20, 4) of a gait with neutral ankles; phases (T,) in cycles.

    In mid-stance the sole stays flat and the shank turns over it; towards initial contact and toe-off the
    ankle returns to the angle that is flat on average; in swing the toes are lifted, farther where the foot
    would not clear the ground.
    """
    frames = body_kinematics(rotations)[1]
    return until_clear(
        lambda lifts: _with_neutral_ankles(rotations, frames, phase, SWING_TOE_LIFT + lifts), phase
    )


def _with_neutral_ankles(rotations: Array, frames: Array, phase: Array, lifts: Array) -> Array:
    out = rotations.copy()
    for side, stance, lift in zip(SIDES, foot_phases(phase), lifts, strict=True):
        knee, ankle = N[f"knee_{side}"], N[f"ankle_{side}"]
        lean, yaw = lean_and_yaw(frames[:, knee])
        # Flat from heel-down to heel-off: 10 to 36 % of the stride.
        weight = np.clip(np.minimum(stance / 0.10, (0.50 - stance) / 0.14), 0.0, 1.0)
        middle = (stance > 0.08) & (stance < 0.38)
        usual = -float(np.mean(lean[middle])) if middle.any() else 0.0
        angle = usual + weight * (np.clip(-lean, -STANCE_ANKLE_RANGE[1], -STANCE_ANKLE_RANGE[0]) - usual)
        angle -= lift * np.clip(np.minimum((stance - 0.58) / 0.10, (0.95 - stance) / 0.10), 0.0, 1.0)
        angle = fourier.evaluate(fourier.fit(phase, angle, 5), phase)
        foot = multiply(from_axis_angle("Z", yaw), from_axis_angle("Y", lean + angle))
        out[:, ankle] = multiply(conjugate(frames[:, knee]), foot)
    return out


def foot_phases(phase: Array) -> tuple[Array, Array]:
    """The phase of each foot in its own stride, left then right."""
    return np.mod(phase, 1.0), np.mod(phase + 0.5, 1.0)


def until_clear(with_lifts: Callable[[Array], Array], phase: Array) -> Array:
    """Local rotations (T, 20, 4) whose toes are lifted until each foot clears the ground as it passes the
    other.

    A sensor's knee bends too little in swing. with_lifts: rotations for lifts (2,) in radians of the left and
    right toes; phase: (T,) cycles.
    """
    lifts = np.zeros(2)
    # Lifting the toes lowers the heel: a few rounds reach the clearance.
    for _ in range(4):
        heights = sole_positions(*body_kinematics(with_lifts(lifts)))[..., 2].min(axis=-1)
        for foot, stride in enumerate(foot_phases(phase)):
            passing = (stride > FEET_ADJACENT[0]) & (stride < FEET_ADJACENT[1])
            if passing.any():
                # The other foot is on the ground.
                over = float((heights[passing, foot] - heights[passing, 1 - foot]).min())
                lifts[foot] = min(lifts[foot] + max(0.0, MIN_CLEARANCE - over) / TOE_LENGTH, MAX_TOE_LIFT)
    return with_lifts(lifts)


def flat_feet(rotations: Array) -> Array:
    """Local rotations (T, 20, 4) with level soles, headed like the shanks, within the ankle's range.

    Beyond that range the heel rises, as in a lunge, or the toes do.
    """
    out = rotations.copy()
    frames = body_kinematics(rotations)[1]
    for side in SIDES:
        knee, ankle = N[f"knee_{side}"], N[f"ankle_{side}"]
        lean, yaw = lean_and_yaw(frames[:, knee])
        pitch = lean + np.clip(-lean, *LOADED_ANKLE_RANGE)
        foot = multiply(from_axis_angle("Z", yaw), from_axis_angle("Y", pitch))
        out[:, ankle] = multiply(conjugate(frames[:, knee]), foot)
    return out


def lean_and_yaw(frames: Array) -> tuple[Array, Array]:
    """Pitch (forward positive) and heading (T,) in radians of shank frames (T, 4).

    The heading comes from the lateral axis because the front of a runner's shank turns past the vertical.
    """
    lateral = rotate(frames, np.array([0.0, 1.0, 0.0]))
    yaw = np.arctan2(-lateral[:, 0], lateral[:, 1])
    forward = rotate(frames, np.array([1.0, 0.0, 0.0]))
    ahead = forward[:, 0] * np.cos(yaw) + forward[:, 1] * np.sin(yaw)
    return np.arctan2(-forward[:, 2], ahead), yaw
