"""Detects a camera that turns with the walker: planted feet slide across the view while the hips stay put.

Flagged only. Planted feet that move at walking speed while the hips hardly move indicate a treadmill or a
camera that follows the person. A turning camera moves the ground across its line of sight; a treadmill belt
runs in the direction in which the treadmill was set up. A treadmill seen exactly from the side looks the same
as a turning camera.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.spans import frame_runs
from kinemimic.pipeline.locomotion.striding import StridingFrames, striding_frames
from kinemimic.pipeline.quality.rules.defect import Defect

# Speed of the planted foot relative to the walking speed: 0 over a floor, 1 on a belt.
GROUND_SPEED_RATIO = (0.75, 1.25)
# The hips move slower than this share of the walking speed.
MAX_HIP_SPEED_RATIO = 0.6
# Required: this many samples with a planted foot, and this walking speed (m/s).
MIN_SAMPLES = 30
MIN_WALKING_SPEED = 0.4
# Angle between foot slide and line of sight; the treadmills measured were at 0 to 60 degrees.
MIN_SLIDE_ANGLE = np.radians(75.0)
# Length of the mean unit facing vector: 0.6 to 0.9 in front of a following camera. A dancer who turns on the
# spot faces all directions.
MIN_FACING_CONSISTENCY = 0.3


def detect(clip: Clip) -> list[Defect]:
    """The defect "turning_camera", flagged; no repair, since the file lacks the camera's orientation."""
    found = striding_frames(clip)
    if len(found.frames) < MIN_SAMPLES or not ground_moves(found):
        return []
    angle = slide_angle(found)
    if angle < MIN_SLIDE_ANGLE or np.linalg.norm(found.forward.mean(axis=0)) < MIN_FACING_CONSISTENCY:
        return []
    speed = float(np.median(np.linalg.norm(found.foot_velocity, axis=1)))
    inside = np.zeros(len(clip.times), dtype=np.bool_)
    inside[found.frames] = True
    text = (
        f"planted feet slide at {speed:.2f} m/s, {np.degrees(angle):.0f} deg from the line of sight, while "
        "the hips stay in place: the camera turns with the walker (a treadmill seen from the side looks the "
        "same); the path of the hips is not the path walked, joint angles are not affected"
    )
    return [Defect("turning_camera", len(found.frames), "frames", "flagged", text, frame_runs(inside))]


def ground_moves(found: StridingFrames) -> bool:
    """True if the ground moves under the walker: on a treadmill, or in front of a turning camera."""
    walk = found.walking_velocity
    squared = np.sum(walk**2, axis=1)
    if np.sqrt(np.median(squared)) < MIN_WALKING_SPEED:
        return False
    share = float(np.median(-np.sum(found.foot_velocity * walk, axis=1) / np.maximum(squared, 1e-12)))
    hips = float(np.median(np.linalg.norm(found.hip_velocity, axis=1)))
    limit = MAX_HIP_SPEED_RATIO * float(np.sqrt(np.median(squared)))
    return GROUND_SPEED_RATIO[0] <= share <= GROUND_SPEED_RATIO[1] and hips < limit


def slide_angle(found: StridingFrames) -> float:
    """Angle in [0, π/2] between the line of sight and the axis along which planted feet slide.

    The line of sight starts at the origin. An axis has no sign, so angles are doubled before averaging,
    weighted by the squared speed.
    """
    place, velocity = found.foot_position, found.foot_velocity
    sight = (place[:, 0] + 1j * place[:, 1]) / np.linalg.norm(place, axis=1)
    slide = (velocity[:, 0] + 1j * velocity[:, 1]) * np.conj(sight)
    return float(np.abs(0.5 * np.angle(np.sum(slide**2))))
