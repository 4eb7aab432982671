"""How much the fit trusts each of its terms: standard deviations in metres, radians and seconds."""

from __future__ import annotations

from dataclasses import dataclass

# Of a point in the image, as metres on a person of average height: what a marker's place on the skin, clothes
# and the network leave open. Joints under flesh are worse than bony ones.
POINT_ERRORS: dict[str, float] = {
    "hip": 0.050,
    "knee": 0.018,
    "instep": 0.018,
    "heel": 0.025,
    "foot": 0.025,
    "shoulder": 0.025,
    "elbow": 0.022,
    "wrist": 0.025,
    "ear": 0.030,
    "nose": 0.030,
}
# Accelerations that movements of a person reach: metres or radians per second squared.
ACCELERATIONS: dict[str, float] = {
    "root": 4.0,
    "pelvis": 20.0,
    "trunk": 20.0,
    "head": 30.0,
    "thigh": 40.0,
    "shank": 70.0,
    "foot": 80.0,
    "upper_arm": 50.0,
    "forearm": 80.0,
}
# Angles (radians) of joints about standing upright: rotation vectors about X (to the side), Y (to the front),
# Z (about the bone). None leaves a direction open.
RANGES: dict[str, tuple[float, float, float]] = {
    "trunk": (0.2, 0.4, 0.25),
    "head": (0.3, 0.4, 0.5),
    "foot": (0.15, 0.35, 0.15),
    "upper_arm": (1.2, 1.2, 1.2),
}


@dataclass(frozen=True)
class FitSettings:
    """Switches and weights of the terms.

    image, depth, floor, limits, smooth: whether the term counts. robust: errors beyond this many standard
    deviations lose weight. depth_error: metres, of the depth between two joints; floor_error: metres, of a
    standing foot's height; slip: metres per second of a standing foot; memory: seconds over which errors of
    the landmarks are alike; views: number of independent views that a clip counts as at most, against what is
    expected of the lengths and the camera, because the errors of a network are alike in all frames.
    pitch_error, roll_error: radians, of a camera that is expected level; focal_error: of the logarithm of a
    focal length that is assumed, not known (`focal_known`).
    """

    image: bool = True
    depth: bool = True
    floor: bool = True
    limits: bool = True
    smooth: bool = True
    robust: float = 2.0
    depth_error: float = 0.20
    floor_error: float = 0.02
    slip: float = 0.05
    memory: float = 0.3
    views: float = 10.0
    pitch_error: float = 0.15
    roll_error: float = 0.03
    focal_error: float = 0.08
    focal_known: bool = False
