"""Detects a clip whose vertical is not +Z, from the axis along which the body stands, and rotates it upright.

Only a body that walks, steps or squats is rotated. Lying, crawling and push-ups look like standing on the
side, so without such movement the defect is flagged.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.body_points import bend, between, nodes_of, place
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import conjugate, from_axis_angle, multiply, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, SIDES
from kinemimic.pipeline.kinematics.vectors import unit
from kinemimic.pipeline.quality.rules.defect import Defect

# Angle between trunk and legs of a straight body, standing or lying.
MAX_BEND = np.radians(35.0)
# The most upright tenth of the straight frames is at least this far from +Z, and this close to another axis.
MIN_TILT = np.radians(50.0)
MAX_AXIS_ERROR = np.radians(30.0)
# Metres. A standing body walks this far across its long axis, and farther than along it, …
MIN_WALK = 1.0
# … or swings both ankles this far to either side of the hips, which the floor prevents when lying, …
MIN_ANKLE_SWING = 0.10
# … or lowers the hips by this much over planted ankles, on knees whose bend changes by this much.
MIN_SQUAT_DEPTH = 0.15
MIN_SQUAT_KNEE_RANGE = np.radians(40.0)
# Rotations that turn each axis up (onto +Z): axis and angle.
_TURNS: dict[str, tuple[str, float]] = {
    "+X": ("Y", -0.5 * np.pi),
    "-X": ("Y", 0.5 * np.pi),
    "+Y": ("X", 0.5 * np.pi),
    "-Y": ("X", -0.5 * np.pi),
    "-Z": ("X", np.pi),
}


def repair(clip: Clip) -> tuple[Clip, list[Defect]]:
    """The clip rotated so that the body stands along +Z.

    Only the most upright postures count, so that bending, sitting down or a slightly tilted camera have no
    effect.
    """
    points = nodes_of(clip)
    trunk = unit(between(points, "hips", "shoulders"))
    legs = unit(between(points, "ankles", "hips"))
    straight = np.sum(trunk * legs, axis=-1) > np.cos(MAX_BEND)
    if straight.sum() < 0.1 * len(straight):
        straight = np.isfinite(trunk).all(axis=-1)
    if not straight.any():
        return clip, []
    postures = trunk[straight]
    if np.percentile(postures[:, 2], 90.0) > np.cos(MIN_TILT):
        return clip, []
    candidates = {axis: rotate(from_axis_angle(*turn), postures)[:, 2] for axis, turn in _TURNS.items()}
    # Before a tilted sensor, too, whose horizontal a bending trunk comes nearer to.
    upside_down = (
        np.percentile(candidates["-Z"], 90.0) > np.cos(MIN_TILT) and np.median(candidates["-Z"]) > 0.5
    )
    axis = max(candidates, key=lambda name: float(np.percentile(candidates[name], 90.0)))
    axis = "-Z" if upside_down else axis
    best = float(np.degrees(np.arccos(np.clip(np.percentile(candidates[axis], 90.0), -1.0, 1.0))))
    found = f"at its most upright the body stands along the {axis} axis (within {best:.0f} deg), not +Z"
    clear = best < np.degrees(MAX_AXIS_ERROR) and np.mean(candidates[axis] > np.cos(MIN_TILT)) > 0.5
    clear |= upside_down
    frames = int(straight.sum())
    if not clear:
        text = f"the body never stands along +Z; nearest is {axis}, off by {best:.0f} deg; left as recorded"
        return clip, [Defect("wrong_up_axis", frames, "frames", "flagged", text)]
    up = rotate(conjugate(from_axis_angle(*_TURNS[axis])), np.array([0.0, 0.0, 1.0]))
    # Nobody does a headstand for most of a recording.
    if axis != "-Z" and not _stands(points, up):
        text = f"{found}; but it neither walks nor squats, and may be lying or crawling; left as recorded"
        return clip, [Defect("wrong_up_axis", frames, "frames", "flagged", text)]
    return rotated_clip(clip, from_axis_angle(*_TURNS[axis])), [
        Defect("wrong_up_axis", frames, "frames", "repaired", f"{found}; rotated upright")
    ]


def rotated_clip(clip: Clip, turn: Array) -> Clip:
    """The clip rotated by a quaternion: positions, root rotation and the axes of the file."""
    rotations = clip.rotations
    if rotations is not None:
        rotations = rotations.copy()
        roots = [joint for joint, parent in enumerate(clip.skeleton.parents) if parent < 0]
        rotations[:, roots] = multiply(np.broadcast_to(turn, rotations[:, roots].shape), rotations[:, roots])
    return replace(
        clip,
        positions=rotate(turn, clip.positions),
        world_from_file=multiply(turn, clip.world_from_file),
        rotations=rotations,
    )


def _stands(points: Array, up: Array) -> bool:
    """True if the body (T, 20, 3) moves as only a standing body can, if `up` (3,) is up."""
    hips = place(points, "hips")
    across, along = _ways(hips, unit(between(points, "hips", "shoulders")))
    if across > max(MIN_WALK, along):
        return True
    ankles = [points[:, NODE_INDEX[f"ankle_{side}"]] for side in SIDES]
    beside = [ankle - hips for ankle in ankles]
    beside = [direction - np.outer(direction @ up, up) for direction in beside]
    apart = beside[0] - beside[1]
    apart = apart[np.isfinite(apart).all(axis=-1)]
    if len(apart) < 2:
        return False
    swing = np.linalg.eigh(np.cov(apart.T))[1][:, -1]  # the axis along which the ankles pass each other
    ends = [_ends((direction @ swing)[:, None])[:, 0] for direction in beside]
    if all(low < -MIN_ANKLE_SWING and high > MIN_ANKLE_SWING for low, high in ends):
        return True
    lowered = _travel((hips @ up)[:, None])
    planted = max(_travel(ankle) for ankle in ankles)
    bends = [_travel(bend(points, side)[:, None]) for side in SIDES]
    return lowered > max(MIN_SQUAT_DEPTH, 2.0 * planted) and min(bends) > MIN_SQUAT_KNEE_RANGE


def _ways(hips: Array, trunk: Array) -> tuple[float, float]:
    """How far the hips (T, 3) come across the trunk's direction (T, 3) of each frame, and along it: who walks
    comes across, who crawls along."""
    seen = np.isfinite(hips).all(axis=-1) & np.isfinite(trunk).all(axis=-1)
    if seen.sum() < 2:
        return 0.0, 0.0
    # In the middle of each step: the hips' noise is in both, and would add up.
    steps, direction = np.diff(hips[seen], axis=0), unit(trunk[seen][1:] + trunk[seen][:-1])
    along = np.sum(steps * direction, axis=-1, keepdims=True)
    return _travel(np.cumsum(steps - along * direction, axis=0)), _travel(np.cumsum(along, axis=0))


def _travel(places: Array) -> float:
    """The largest extent of positions (T, n) along an axis, over the middle 90 % (see `_ends`)."""
    low, high = _ends(places)
    return float(np.max(high - low))


def _ends(places: Array) -> Array:
    """5th and 95th percentile (2, n) of positions (T, n) along each axis; 0 if all are missing."""
    finite = places[np.isfinite(places).all(axis=-1)]
    return np.percentile(finite, [5.0, 95.0], axis=0) if len(finite) else np.zeros((2, places.shape[1]))
