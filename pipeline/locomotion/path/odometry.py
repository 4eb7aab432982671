"""The path over the ground, from the feet alone: a foot that carries the body does not move.

The pose about the pelvis gives the velocity of the pelvis over the foot in stance. Between stances, and where
no foot is still enough, the centre of mass keeps its velocity: between two feet its speed is interpolated,
and in flight nothing but gravity acts on it. The recorded path is not used, so the same path results on a
floor, on a treadmill, before a camera that turns with the walker, and from poses without a root.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.body_points import place
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.pipeline.locomotion.path.upright import center_of_mass
from kinemimic.pipeline.locomotion.phase import fourier


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
# of the leg above the other. Measured: walking up to 0.09, running 0.11 to 0.33.
RUNNING_LIFT = 0.14
# Steps as quick as these (s of a stride) are a runner's from a lower lift on. Legs shorter than an adult's
# (m) swing faster in walking too, as pendulums do.
QUICK_STRIDE, QUICK_LIFT, ADULT_LEG = 0.82, 0.08, 0.75
# Share of the leg, of the hips' wave in a step: brisk walkers have 0.013 to 0.018. Less is no vault: where
# the root was left out, the hips still move by up to 0.004 about the point that is fixed in its place.
LEAST_VAULT = 0.006
# m rms of the lowest ankle or toes: as level as no walker's (11 to 45 mm), so the height was made from them.
LEVEL = 4e-3
FEET_ERROR = 0.08  # of the speed of single strides by the feet
_SMOOTHING = 0.03  # s, of the velocity


@dataclass(frozen=True)
class FootOdometry:
    """velocity: (T, 2) m/s of the middle of the hips over the ground, in the axes of the positions; running:
    whether the gait is running; backward: whether the feet in stance move forward under the body, as in a
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
    root = place(positions, "hips")
    pose = positions - root[:, None]
    vaults = _vaults(positions, phase)
    if _steps_backward(pose, phase):
        # Walking backward is walking forward in reversed time.
        reverse = _forward_odometry(pose[::-1], heading[::-1], -phase[::-1], rate, vaults=vaults, toes=toes)
        return FootOdometry(
            -reverse.velocity[::-1],
            reverse.running,
            backward=True,
            single=-reverse.single[:, ::-1],
            weights=reverse.weights[:, ::-1],
        )
    return _forward_odometry(pose, heading, phase, rate, vaults=vaults, toes=toes)


def _forward_odometry(
    pose: Array, heading: Array, phase: Array, rate: float, *, vaults: bool, toes: bool
) -> FootOdometry:
    """`foot_odometry` of a pose (T, 20, 3) about the hips that walks forward."""
    forward = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    running = is_running_pose(pose, phase, rate) and not vaults
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
    leg = _leg_length(pose)
    stride = len(phase) / rate / max(float(np.ptp(phase)), 1e-9)
    quick = QUICK_STRIDE * np.sqrt(min(1.0, leg / ADULT_LEG))
    least = QUICK_LIFT if stride < quick else RUNNING_LIFT
    return bool(np.median(both) > least * leg)


def _leg_length(positions: Array) -> float:
    """Metres from hip to ankle along the left leg, for positions (T, 20, 3)."""
    hip, knee, ankle = (positions[:, N[f"{joint}_left"]] for joint in ("hip", "knee", "ankle"))
    return float(np.median(np.linalg.norm(hip - knee, axis=-1) + np.linalg.norm(knee - ankle, axis=-1)))


def _vaults(positions: Array, phase: Array) -> bool:
    """Whether the hips are lowest when the feet are farthest apart: a walker vaults over the foot in stance,
    a runner bounces. The rear foot alone does not tell: in a brisk walk its heel, and down a slope the whole
    foot, is as high as a jogger's.
    """
    ankles, toes = (positions[:, [N[f"{joint}_{side}"] for side in SIDES], 2] for joint in ("ankle", "foot"))
    for heights in (ankles, toes, np.concatenate([ankles, toes], axis=1)):
        if np.std(heights.min(axis=1)) < LEVEL:  # every frame was put on the ground, a runner's flight too
            return False
    columns = np.column_stack([fourier.design(2.0 * phase, 1), phase])
    _, apart, _, _ = np.linalg.lstsq(columns, place(positions, "hips")[:, 2])[0]
    return bool(apart < -LEAST_VAULT * _leg_length(positions))


def _steps_backward(pose: Array, phase: Array) -> bool:
    """Whether the foot that moves back is the higher one: then it swings, and the body moves backward."""
    left_stance = np.mod(phase, 1.0) < 0.5
    height = pose[:, N["ankle_left"], 2] - pose[:, N["ankle_right"], 2]
    return bool(np.mean(np.where(left_stance, height, -height)) > 0.0)
