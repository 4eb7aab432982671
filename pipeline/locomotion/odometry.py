"""The path over the ground, from the feet alone: a foot that carries the body does not move.

The pose about the pelvis gives the velocity of the pelvis over the foot in stance. Between stances, and where
no foot is still enough, the centre of mass keeps its velocity: between two feet its speed is interpolated,
and in flight nothing but gravity acts on it. The recorded path is not used, so the same path results on a
floor, on a treadmill, before a camera that turns with the walker, and from poses without a root.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.ndimage import gaussian_filter1d

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.locomotion.upright import center_of_mass

SIDES = ("left", "right")


@dataclass(frozen=True)
class _Rolling:
    """How far a point of the foot in stance still moves, from heel strike over the forefoot to toe-off.

    phase: (K,) cycles since the foot was farthest ahead; share: (K,) of the body's speed at which the point
    moves forward; the point counts between the first and the last phase. Means of the recordings named below,
    0.05 cycles apart.
    """

    phase: tuple[float, ...]
    share: tuple[float, ...]


# Walks 02_01, 05_01 and 07_01 of the CMU motion capture database at 0.9, 1.2 and 1.4 m/s agree to 0.02 of the
# speed up to phase 0.4 and to 0.05 at 0.475. The toe joint takes over where the heel has risen.
_WALKING_ANKLE = _Rolling(
    (0.03, 0.075, 0.125, 0.175, 0.225, 0.275, 0.325, 0.375, 0.425, 0.475),
    (0.10, 0.02, 0.02, 0.01, 0.035, 0.035, 0.055, 0.075, 0.11, 0.25),
)
_WALKING_TOE = _Rolling(
    (0.25, 0.275, 0.325, 0.375, 0.425, 0.475, 0.50), (0.02, 0.02, 0.03, 0.025, 0.035, 0.07, 0.12)
)
# Runs 02_03 and 09_01 at 2.6 and 3.6 m/s. The foot is on the ground for a third of the stride at most.
_RUNNING_ANKLE = _Rolling((0.10, 0.125, 0.175, 0.225, 0.26), (0.15, 0.10, 0.055, 0.055, 0.12))
_RUNNING_TOE = _Rolling(
    (0.10, 0.125, 0.175, 0.225, 0.275, 0.325, 0.36), (0.12, 0.08, 0.04, 0.01, 0.04, 0.13, 0.2)
)
# In running the rear foot has left the ground when the feet are farthest apart: its ankle is then this share
# of the leg above the other. Measured: walking 0.02 to 0.08, running 0.2 to 0.4.
RUNNING_LIFT = 0.14
# Steps as quick as these (s of a stride) are a runner's from a lower lift on.
QUICK_STRIDE, QUICK_LIFT = 0.82, 0.08
FEET_ERROR = 0.08  # of the speed of single strides by the feet
_SMOOTHING = 0.03  # s, of the velocity


@dataclass(frozen=True)
class FootOdometry:
    """velocity: (T, 2) m/s of the middle of the hips over the ground, in the axes of the positions; running:
    whether the gait is running; backward: whether the feet in stance move forward under the body, as of a
    person who walks backward; single: (2, T, 2) m/s over the left and over the right foot alone, and weights:
    (2, T) 0 where that foot is not in stance."""

    velocity: Array
    running: bool
    backward: bool
    single: Array
    weights: Array


def foot_odometry(positions: Array, heading: Array, phase: Array, rate: float, *, toes: bool) -> FootOdometry:
    """Velocity of the body over the ground from positions (T, 20, 3) with Z up, in any horizontal place.

    heading: (T,) radians; phase: (T,) cycles, integer where the left ankle is farthest ahead; rate: frames
    per second; toes: whether the recording shows where the toes are, to a centimetre.
    """
    root = 0.5 * (positions[:, N["hip_left"]] + positions[:, N["hip_right"]])
    pose = positions - root[:, None]
    if _steps_backward(pose, phase):
        # Walking backward is walking forward in reversed time.
        reverse = _forward_odometry(pose[::-1], heading[::-1], -phase[::-1], rate, toes=toes)
        return FootOdometry(
            -reverse.velocity[::-1],
            reverse.running,
            backward=True,
            single=-reverse.single[:, ::-1],
            weights=reverse.weights[:, ::-1],
        )
    return _forward_odometry(pose, heading, phase, rate, toes=toes)


def _forward_odometry(pose: Array, heading: Array, phase: Array, rate: float, *, toes: bool) -> FootOdometry:
    """`foot_odometry` of a pose (T, 20, 3) about the hips that walks forward."""
    forward = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    running = is_running_pose(pose, phase, rate)
    profiles = {"ankle": _RUNNING_ANKLE if running else _WALKING_ANKLE}
    if toes:
        profiles["foot"] = _RUNNING_TOE if running else _WALKING_TOE
    totals, each = np.zeros((2, len(pose), 2)), np.zeros((2, len(pose)))
    for foot, side in enumerate(SIDES):
        own = np.mod(phase + 0.5 * foot, 1.0)
        for joint, rolling in profiles.items():
            speed = -rate * np.gradient(pose[:, N[f"{joint}_{side}"], :2], axis=0)
            share = np.interp(own, rolling.phase, rolling.share)
            along = np.einsum("tk,tk->t", speed, forward)
            carried = speed + (along * share / (1.0 - share))[:, None] * forward
            weight = _taper(own, rolling.phase[0], rolling.phase[-1]) * (1.0 - share) ** 2
            totals[foot] += weight[:, None] * carried
            each[foot] += weight
    single = totals / np.maximum(each, 1e-9)[..., None]
    total, weights = totals.sum(axis=0), each.sum(axis=0)
    known = weights > 0.05
    if known.sum() < 2:
        return FootOdometry(np.zeros((len(pose), 2)), running, backward=False, single=single, weights=each)
    # The pelvis swings about the centre of mass, whose velocity is what is interpolated.
    swing = rate * np.gradient(center_of_mass(pose)[:, :2], axis=0)
    of_mass = total[known] / weights[known, None] + swing[known]
    at = np.arange(len(pose))
    velocity = np.stack([np.interp(at, at[known], column) for column in of_mass.T], axis=1) - swing
    velocity = gaussian_filter1d(velocity, _SMOOTHING * rate, axis=0, mode="nearest")
    return FootOdometry(np.asarray(velocity), running, backward=False, single=single, weights=each)


def _taper(own: Array, first: float, last: float) -> Array:
    """Weight (T,) of a point between two phases: it fades in and out over a twentieth of the stride."""
    return np.clip(np.minimum(own - first, last - own) / 0.05, 0.0, 1.0)


def is_running_pose(pose: Array, phase: Array, rate: float) -> bool:
    """Whether the rear foot is in the air when the feet are farthest apart; pose: (T, 20, 3) about the
    hips.
    """
    lifts = []
    for foot, (rear, ahead) in enumerate((("right", "left"), ("left", "right"))):
        # Farthest apart: a little after the front foot was farthest ahead of the pelvis.
        apart = np.abs(np.mod(phase + 0.5 * foot + 0.5, 1.0) - 0.5) < 0.04
        lift = pose[:, N[f"ankle_{rear}"], 2] - pose[:, N[f"ankle_{ahead}"], 2]
        lifts.append(lift[apart])
    both = np.concatenate(lifts)
    if not len(both):
        return False
    leg = np.median(
        np.linalg.norm(pose[:, N["hip_left"]] - pose[:, N["knee_left"]], axis=-1)
        + np.linalg.norm(pose[:, N["knee_left"]] - pose[:, N["ankle_left"]], axis=-1)
    )
    stride = len(phase) / rate / max(float(np.ptp(phase)), 1e-9)
    least = QUICK_LIFT if stride < QUICK_STRIDE else RUNNING_LIFT
    return bool(np.median(both) > least * leg)


def _steps_backward(pose: Array, phase: Array) -> bool:
    """Whether the foot that moves back is the higher one: then it swings, and the body moves backward."""
    left_stance = np.mod(phase, 1.0) < 0.5
    height = pose[:, N["ankle_left"], 2] - pose[:, N["ankle_right"], 2]
    return bool(np.mean(np.where(left_stance, height, -height)) > 0.0)


@dataclass(frozen=True)
class GroundPath:
    """Where the speed of a bout comes from.

    source: "recorded" where the recorded path agrees with the feet; "feet" where the body stays in place
    while the feet carry it, as on a treadmill, before a camera that turns with the walker, or without a root;
    "neither" where the body's path does not match its steps, as in steps to the side. disagreement:
    median distance per stride between both, over the length of the stride by the feet; velocity: (T, 2) m/s,
    the one that is used.
    """

    source: Literal["recorded", "feet", "neither"]
    disagreement: float
    velocity: Array


# Share of a stride's length by which a recorded path may differ from the feet: by optical recordings, whose
# feet alone are off by 5 %, and by depth sensors. Share of the feet's speed below which the body stays in
# place.
MAX_DISAGREEMENT = {True: 0.20, False: 0.35}
MAX_STRIDE_DISAGREEMENT = 0.35  # of a single stride of an optical recording
IN_PLACE = 0.5
# From the foot that agrees better: a sound leg beside a limping one agrees to 0.03; legs that a sensor
# exchanged, to 0.09.
MAX_ONE_FOOT = 0.06
MIN_STANCE_FRAMES = 5  # of one foot within a stride
_SLOW = 0.3  # m/s: at lower speeds, differences count as of this speed


def disagreements(root: Array, feet: FootOdometry, phase: Array, edges: Array, rate: float) -> Array:
    """Per stride (K, 3), the distance between recorded path and feet, the length of the path, both over that
    by feet, and the distance from the foot that agrees better, while it stands.

    A leg that limps is on the ground for a shorter part of the stride than is expected here; the other one
    carries the body.

    root: (T, 3) metres, the recorded middle of the hips; phase: (T,) cycles; edges: (K, 2) first and last
    phase of each stride; NaN for a stride without frames.
    """
    recorded = rate * np.gradient(root[:, :2], axis=0)
    out = np.full((len(edges), 3), np.nan)
    for k, (start, end) in enumerate(edges):
        mine = slice(*np.searchsorted(phase, (start, end)))
        if mine.stop - mine.start < 2:
            continue
        by_feet, by_path = feet.velocity[mine].mean(axis=0), recorded[mine].mean(axis=0)
        speed = max(float(np.linalg.norm(by_feet)), _SLOW)
        apart = float(np.linalg.norm(by_path - by_feet)) / speed
        out[k] = apart, np.linalg.norm(by_path) / speed, apart
        for over, weights in zip(feet.single[:, mine], feet.weights[:, mine], strict=True):
            if np.count_nonzero(weights) < MIN_STANCE_FRAMES:
                continue
            by_foot, then = (np.average(one, axis=0, weights=weights) for one in (over, recorded[mine]))
            size = max(float(np.linalg.norm(by_foot)), _SLOW)
            out[k, 2] = min(out[k, 2], float(np.linalg.norm(then - by_foot)) / size)
    return out


def choose_path(root: Array, feet: FootOdometry, apart: Array, rate: float, *, precise: bool) -> GroundPath:
    """The recorded path where it agrees with the feet, or in an optical recording with one of them, else the
    feet.

    apart: of `disagreements`, of whole strides if there are any.
    """
    known = apart[np.isfinite(apart).all(axis=1)]
    recorded = rate * np.gradient(root[:, :2], axis=0)
    if not len(known):
        return GroundPath("neither", float("inf"), recorded)
    disagreement, moved, of_one_foot = np.median(known, axis=0).tolist()
    if disagreement < MAX_DISAGREEMENT[precise]:
        return GroundPath("recorded", disagreement, recorded)
    if moved < IN_PLACE:
        return GroundPath("feet", disagreement, feet.velocity)
    # A depth sensor may well show one of two feet so that it agrees by chance.
    if precise and of_one_foot < MAX_ONE_FOOT:
        return GroundPath("recorded", of_one_foot, recorded)
    return GroundPath("neither", disagreement, feet.velocity)


def steady_velocity(velocity: Array, phase: Array, speed: float) -> Array:
    """Forward velocity (T,) by the feet whose mean over each stride is the speed, if it hardly differs
    anyway.
    """
    at = np.arange(len(phase))
    early, late = (np.interp(phase + shift, phase, at) for shift in (-0.5, 0.5))
    way = np.concatenate([[0.0], np.cumsum(0.5 * (velocity[1:] + velocity[:-1]))])
    mean = (np.interp(late, at, way) - np.interp(early, at, way)) / np.maximum(late - early, 1.0)
    # A part of a stride has another mean.
    whole = np.interp(late, at, phase) - np.interp(early, at, phase) > 0.99
    if not whole.any() or float(np.std(mean[whole])) > FEET_ERROR * abs(speed):
        return velocity
    return np.asarray(velocity + np.mean(mean[whole]) - np.interp(at, at[whole], mean[whole]))
