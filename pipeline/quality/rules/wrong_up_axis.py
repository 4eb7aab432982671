"""Which way is up: the standing body says so, whatever the file's axes were taken for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.body_points import bend, between, nodes_of, place, unit
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import conjugate, from_axis_angle, multiply, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.quality.rules.defect import Defect

# Trunk and legs within this angle of one line: a body that stands, or lies straight.
STRAIGHT = np.radians(35.0)
# The most upright tenth of the straight frames is this far from our up-axis, and this near to another one.
WRONG = np.radians(50.0)
NEAR = np.radians(30.0)
# Metres. Who stands walks this far across the body's length, …
WALK = 1.0
# … or lets both ankles swing this far to either side of the hips, where a floor leaves no room for it, …
SWING = 0.10
# … or lowers the hips by this much over ankles that stay, on knees whose bend changes by this much.
SQUAT = 0.15
SQUAT_KNEES = np.radians(40.0)
# The turns that bring each axis up (onto +Z): about which of our axes, by how much.
_TURNS: dict[str, tuple[str, float]] = {
    "+X": ("Y", -0.5 * np.pi),
    "-X": ("Y", 0.5 * np.pi),
    "+Y": ("X", 0.5 * np.pi),
    "-Y": ("X", -0.5 * np.pi),
    "-Z": ("X", np.pi),
}


def repair(clip: Clip) -> tuple[Clip, list[Defect]]:
    """The clip with its up-axis turned up. Told by the clip's most upright postures, so that bending,
    sitting down or a lift to the camera of some degrees change nothing. Who lies, crawls or does push-ups
    looks like a standing body on its side; so only one that walks, steps or squats is turned, others are
    flagged.
    """
    points = nodes_of(clip)
    trunk = unit(between(points, "hips", "shoulders"))
    legs = unit(between(points, "ankles", "hips"))
    straight = np.sum(trunk * legs, axis=-1) > np.cos(STRAIGHT)
    if straight.sum() < 0.1 * len(straight):
        straight = np.isfinite(trunk).all(axis=-1)
    if not straight.any():
        return clip, []
    postures = trunk[straight]
    if np.percentile(postures[:, 2], 90.0) > np.cos(WRONG):
        return clip, []
    candidates = {axis: rotate(from_axis_angle(*turn), postures)[:, 2] for axis, turn in _TURNS.items()}
    axis = max(candidates, key=lambda name: float(np.percentile(candidates[name], 90.0)))
    best = float(np.degrees(np.arccos(np.clip(np.percentile(candidates[axis], 90.0), -1.0, 1.0))))
    found = f"at its most upright the body stands along our {axis} axis (within {best:.0f} deg), not along +Z"
    clear = best < np.degrees(NEAR) and np.mean(candidates[axis] > np.cos(WRONG)) > 0.5
    frames = int(straight.sum())
    if not clear:
        text = f"the body never stands along +Z; nearest is {axis}, off by {best:.0f} deg: left as it is"
        return clip, [Defect("wrong_up_axis", frames, "frames", "flagged", text)]
    up = rotate(conjugate(from_axis_angle(*_TURNS[axis])), np.array([0.0, 0.0, 1.0]))
    # Nobody stands on the head for most of a recording.
    if axis != "-Z" and not _stands(points, up):
        text = f"{found}; but it neither walks nor squats: who lies or crawls looks the same; left as it is"
        return clip, [Defect("wrong_up_axis", frames, "frames", "flagged", text)]
    return turned(clip, from_axis_angle(*_TURNS[axis])), [
        Defect("wrong_up_axis", frames, "frames", "repaired", f"{found}; turned up")
    ]


def turned(clip: Clip, turn: Array) -> Clip:
    """The clip in a world turned by a quaternion: positions, root rotation and the file's axes together."""
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
    """True if the body (T, 20, 3) moves as only a standing one does, were `up` (3,) up."""
    hips = place(points, "hips")
    if _travel(hips - np.outer(hips @ up, up)) > WALK:
        return True
    ankles = [points[:, NODE_INDEX[f"ankle_{side}"]] for side in ("left", "right")]
    beside = [ankle - hips for ankle in ankles]
    beside = [way - np.outer(way @ up, up) for way in beside]
    apart = beside[0] - beside[1]
    apart = apart[np.isfinite(apart).all(axis=-1)]
    if len(apart) < 2:
        return False
    swing = np.linalg.eigh(np.cov(apart.T))[1][:, -1]  # the line on which the ankles pass each other
    ends = [_ends((way @ swing)[:, None])[:, 0] for way in beside]
    if all(low < -SWING and high > SWING for low, high in ends):
        return True
    lowered = _travel((hips @ up)[:, None])
    planted = max(_travel(ankle) for ankle in ankles)
    bends = [_travel(bend(points, side)[:, None]) for side in ("left", "right")]
    return lowered > max(SQUAT, 2.0 * planted) and min(bends) > SQUAT_KNEES


def _travel(places: Array) -> float:
    """The widest extent of places (T, n), as `_ends` has it."""
    low, high = _ends(places)
    return float(np.max(high - low))


def _ends(places: Array) -> Array:
    """Where the middle 90 % of places (T, n) begin and end along each axis, (2, n); 0 if none is there."""
    there = places[np.isfinite(places).all(axis=-1)]
    return np.percentile(there, [5.0, 95.0], axis=0) if len(there) else np.zeros((2, places.shape[1]))
