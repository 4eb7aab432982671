"""Which way is up: the standing body says so, whatever the file's axes were taken for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.clip import Clip
from kinemimic.pipeline.defect import Defect
from kinemimic.pipeline.rotations import from_axis_angle, multiply, rotate
from kinemimic.pipeline.rules.body import between, nodes_of, unit

Array = NDArray[np.float64]

# Trunk and legs within this angle of one line: a body that stands, or lies straight.
STRAIGHT = np.radians(35.0)
# The most upright tenth of the straight frames is this far from our up-axis, and this near to another one.
WRONG = np.radians(50.0)
NEAR = np.radians(30.0)
# Who lies does not move the hips by this much (metres), who walks or squats does.
TRAVEL = 0.15
# The turns that bring each axis up (onto +Z): about which of our axes, by how much.
_TURNS: dict[str, tuple[str, float]] = {
    "+X": ("Y", -0.5 * np.pi),
    "-X": ("Y", 0.5 * np.pi),
    "+Y": ("X", 0.5 * np.pi),
    "-Y": ("X", -0.5 * np.pi),
    "-Z": ("X", np.pi),
}


def check(clip: Clip) -> tuple[Clip, list[Defect]]:
    """The clip with its up-axis turned up. Told by the clip's most upright postures, so that bending,
    sitting down or a lift to the camera of some degrees change nothing; a body that lies still along an axis
    all the time may be a person who lies, and is only flagged.
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
    if _travel(between(points, "hips", "ankles")) < TRAVEL and _travel(points[:, 0]) < TRAVEL:
        text = f"{found}; but it hardly moves, so that a person who lies looks the same: left as it is"
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


def _travel(places: Array) -> float:
    """The widest extent (metres) of the middle 90 % of places (T, 3); 0 if none is there."""
    there = places[np.isfinite(places).all(axis=-1)]
    if not len(there):
        return 0.0
    low, high = np.percentile(there, [5.0, 95.0], axis=0)
    return float(np.max(high - low))
