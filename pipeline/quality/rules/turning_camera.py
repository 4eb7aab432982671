"""A camera that turns with the walker: the feet that stand slide sideways past it, and the hips stay in view.

Planted feet that move as fast as the walk, while the hips hardly move, mean that not the person but the view
travels: on a treadmill, or with a camera that turns to follow. A turning camera moves the ground across its
line of sight; a belt runs where the treadmill stands. One that is seen exactly from the side cannot be told
apart.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.gait.walking import StridingFrames, striding_frames
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.spans import frame_runs
from kinemimic.pipeline.quality.rules.defect import Defect

# Speed of the planted foot against the ground's own frame: 0 for a walk over the floor, 1 for a belt.
CARRIED = (0.75, 1.25)
# The hips are slower than this share of the walk, and this many moments and this speed (m/s) make a walk.
STAYING = 0.6
ENOUGH = 30
WALKING = 0.4
# Angle between the ground's way and the line of sight; treadmills were found at 0 to 60 degrees.
ACROSS = np.radians(75.0)
# Mean of the unit vectors to where the body faces: 0.6 to 0.9 before a camera that follows; who turns on the
# spot, in a dance, faces all ways.
ONE_WAY = 0.3


def detect(clip: Clip) -> list[Defect]:
    """Flagged, never repaired: where the camera looked is not in the file."""
    found = striding_frames(clip)
    if len(found.frames) < ENOUGH or not ground_moves(found):
        return []
    angle = slide_angle(found)
    if angle < ACROSS or np.linalg.norm(found.forward.mean(axis=0)) < ONE_WAY:
        return []
    speed = float(np.median(np.linalg.norm(found.foot_velocity, axis=1)))
    inside = np.zeros(len(clip.times), dtype=np.bool_)
    inside[found.frames] = True
    text = (
        f"planted feet slide at {speed:.2f} m/s, {np.degrees(angle):.0f} deg from the line of sight, while "
        "the hips stay: the camera turns with the walker (a treadmill seen from its side looks the same), so "
        "that the way of the hips is not the way that was walked; joint angles are not affected"
    )
    return [Defect("turning_camera", len(found.frames), "frames", "flagged", text, frame_runs(inside))]


def ground_moves(found: StridingFrames) -> bool:
    """True if the ground moves under the walker instead of the walker over it."""
    walk = found.walking_velocity
    squared = np.sum(walk**2, axis=1)
    if np.sqrt(np.median(squared)) < WALKING:
        return False
    share = float(np.median(-np.sum(found.foot_velocity * walk, axis=1) / np.maximum(squared, 1e-12)))
    hips = float(np.median(np.linalg.norm(found.hip_velocity, axis=1)))
    return CARRIED[0] <= share <= CARRIED[1] and hips < STAYING * float(np.sqrt(np.median(squared)))


def slide_angle(found: StridingFrames) -> float:
    """Angle in [0, π/2] between the line of sight from the origin and the axis along which feet slide.

    An axis has no sign: angles are doubled before they are averaged, weighted with the squared speed.
    """
    place, velocity = found.foot_position, found.foot_velocity
    sight = (place[:, 0] + 1j * place[:, 1]) / np.linalg.norm(place, axis=1)
    slide = (velocity[:, 0] + 1j * velocity[:, 1]) * np.conj(sight)
    return float(np.abs(0.5 * np.angle(np.sum(slide**2))))
