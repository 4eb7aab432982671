"""The path of the body over the ground: as recorded, or by the feet where the hips stay in place.

On a treadmill, or before a camera that turns with the person, feet in support show where the hips go.
Anywhere else the recorded path is right, and a foot in support that slides is one that a depth sensor sees
badly. The body is as high as its lowest part demands, and in the flight of a run as much higher as the person
was.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.locomotion.path.ground_path import IN_PLACE
from kinemimic.pipeline.locomotion.path.heading import along_heading
from kinemimic.retarget.feet.contact import at_lowest_corner, corner_velocity, sole_positions
from kinemimic.retarget.humanoid.surface import lowest_points
from kinemimic.retarget.live.pose import PoseWindow

# Metres by which the other ankle is higher where a foot begins to carry alone, and where it does for certain;
# weight of a foot that carries with the other.
ALONE = (0.02, 0.06)
BOTH = 0.03
# Metres by which a person's lower ankle is above its usual place before the body is taken to fly.
FLIGHT = {True: 0.05, False: 0.10}
MAX_FLIGHT = 0.6  # m
USUAL = 20.0  # percentile of the lower ankle's height: the ground
RECENT = 0.4  # s from the moment at which the weight of a frame has fallen to 1/e
SLIDE_TIME = 0.5  # s over which the slide of the feet is averaged
_SMOOTHING = 0.04  # s
MAX_SPEED = 8.0  # m/s


@dataclass(frozen=True)
class Step:
    """velocity: (2,) m/s of the hips over the ground, along the axes of the rotations; height: m of the hips
    above the ground."""

    velocity: Array
    height: float


class LivePath:
    """Follows the feet of one capture."""

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._slide: Array | None = None  # (2,) m/s along and across the heading

    def step(self, window: PoseWindow, *, precise: bool) -> Step:
        """Speed and height at the moment of a window."""
        now = window.now
        flight = _flight(window.ankles, now, precise=precise)
        recorded = self._rate * np.gradient(window.hips[:, :2], axis=0)
        recent = np.exp(-np.abs(np.arange(len(recorded)) - now) / (RECENT * self._rate))
        slide = self._averaged(_slide(window, recorded, flight, recent, self._rate), window, recorded)
        smooth = gaussian_filter1d(recorded, _SMOOTHING * self._rate, axis=0, mode="nearest")[now]
        cosine, sine = np.cos(window.heading[now]), np.sin(window.heading[now])
        velocity = smooth - np.array(
            [cosine * slide[0] - sine * slide[1], sine * slide[0] + cosine * slide[1]]
        )
        size = float(np.linalg.norm(velocity))
        if size > MAX_SPEED:
            velocity *= MAX_SPEED / size
        lowest = lowest_points(window.positions, window.frames)[..., 2].min(axis=1)
        height = gaussian_filter1d(flight - lowest, _SMOOTHING * self._rate, mode="nearest")[now]
        return Step(velocity, float(height))

    def _averaged(self, slide: Array, window: PoseWindow, recorded: Array) -> Array:
        """The slide (2,) of the last moments if the hips stay in place over the window, compared with the
        path of the feet, else none."""
        hips = _along(recorded[:, None], window.heading).mean(axis=(0, 1))
        in_place = float(np.linalg.norm(hips)) < IN_PLACE * float(np.linalg.norm(hips - slide))
        found = slide if in_place else np.zeros(2)
        if self._slide is None:
            self._slide = found
        averaged: Array = self._slide + (found - self._slide) / (SLIDE_TIME * self._rate)
        self._slide = averaged
        return averaged


def _slide(window: PoseWindow, recorded: Array, flight: Array, recent: Array, rate: float) -> Array:
    """Velocity (2,) m/s, along and across the heading, of the feet that carry a body whose hips move with
    `recorded` (M, 2): weighted medians, since a foot that swings low seems to carry for some frames.

    recent: (M,) weights of the frames."""
    corners = sole_positions(window.positions, window.frames)
    speed = at_lowest_corner(corners, corner_velocity(corners, rate, None))[..., :2] + recorded[:, None]
    lower = window.ankles[:, ::-1] - window.ankles
    alone = np.clip((lower - ALONE[0]) / (ALONE[1] - ALONE[0]), 0.0, 1.0)
    weight = recent[:, None] * np.where(flight[:, None] > 0.0, 0.0, alone + BOTH * (lower > -ALONE[0]))
    if not weight.any():
        return np.zeros(2)
    ahead = _along(speed, window.heading)
    return np.array([_weighted_median(ahead[..., k].ravel(), weight.ravel()) for k in range(2)])


def _along(velocities: Array, heading: Array) -> Array:
    """Components (M, K, 2) of velocities (M, K, 2) along and across the heading (M,)."""
    upright = np.concatenate([velocities, np.zeros((*velocities.shape[:2], 1))], axis=-1)
    return along_heading(upright, heading)[..., :2]


def _weighted_median(values: Array, weights: Array) -> float:
    order = np.argsort(values, kind="stable")
    total = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(total, 0.5 * total[-1])])


def _flight(ankles: Array, now: int, *, precise: bool) -> Array:
    """Height (M,) in metres by which the body flies, from the ankles (M, 2); the ground is where the lower
    one usually is."""
    lower = ankles.min(axis=1)
    ground = float(np.percentile(lower[: now + 1], USUAL))
    return np.asarray(np.clip(lower - ground - FLIGHT[precise], 0.0, MAX_FLIGHT))
