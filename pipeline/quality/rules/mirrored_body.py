"""A mirrored body: its feet point backward and its knees bend forward, for what is called left and right.

Toes and knees tell forward, trunk tells up, and hips and shoulders tell left; in a mirror they disagree.
Such data come of left-handed axes read as right-handed, or of left and right named the other way round; the
points alone cannot tell which. Names are what a person wrote, axes what a program assumed: so the names are
kept and the points are reflected at the plane Y = 0. If the names were wrong instead, then curves of the left
leg are those of the right.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.body_points import between, nodes_of, unit
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.quality.rules.defect import Defect

# A foot or knee votes in a frame where its sine or cosine is beyond this: a straight knee says nothing.
CLEAR = 0.3
# This share of the votes must say "mirrored", in this many frames at least, and feet and knees must agree.
MAJORITY = 0.8
ENOUGH = 10
_REFLECTION = np.array([1.0, -1.0, 1.0])


def repair(clip: Clip) -> tuple[Clip, list[Defect]]:
    """The clip as its own mirror image, if it is mirrored throughout; Euler captures are only flagged."""
    feet, knees = votes(clip)
    by_feet = len(feet) >= ENOUGH
    if by_feet and np.mean(feet < 0) < MAJORITY:
        return clip, []
    # Without feet (some marker sets) the knees decide alone, and by the same majority.
    by_knees = len(knees) >= ENOUGH
    if by_knees and np.mean(knees < 0) < (0.5 if by_feet else MAJORITY):
        return clip, []
    if not (by_feet or by_knees):
        return clip, []
    says = (
        *([f"feet point backward in {(feet < 0).sum()} of {len(feet)} clear cases"] if by_feet else []),
        *([f"knees bend forward in {(knees < 0).sum()} of {len(knees)} clear cases"] if by_knees else []),
    )
    found = " and ".join(says)
    frames = len(clip.times)
    if not by_knees:
        text = f"{found}, but no knee bends clearly: who sits on the heels looks the same; left as it is"
        return clip, [Defect("mirrored", frames, "frames", "flagged", text)]
    if clip.euler is not None:
        text = f"{found}; left as recorded: a mirror image is no turn, Euler channels cannot express it"
        return clip, [Defect("mirrored", frames, "frames", "flagged", text)]
    lost = "; recorded rotations are left out" if clip.rotations is not None else ""
    text = f"{found}; reflected left to right, names kept{lost}"
    skeleton = replace(clip.skeleton, offsets=clip.skeleton.offsets * _REFLECTION)
    mirrored = replace(
        clip, skeleton=skeleton, positions=clip.positions * _REFLECTION, rotations=None, translations=None
    )
    return mirrored, [Defect("mirrored", frames, "frames", "repaired", text)]


def votes(clip: Clip) -> tuple[Array, Array]:
    """Clear cases, both sides together: the cosine of toes to forward, and the sine of the knee's bend
    (backward positive)."""
    points = nodes_of(clip)
    left = between(points, "hip_right", "hip_left")
    left = left + np.nan_to_num(between(points, "shoulder_right", "shoulder_left"))
    up = between(points, "hips", "shoulders")
    # Who shows no shoulders is taken to stand upright.
    up = np.where(np.isfinite(up).all(axis=-1, keepdims=True), up, [0.0, 0.0, 1.0])
    forward = unit(np.cross(left, up))
    left = unit(left)
    feet: list[Array] = []
    knees: list[Array] = []
    for side in ("left", "right"):
        feet.append(np.sum(unit(between(points, f"ankle_{side}", f"foot_{side}")) * forward, axis=-1))
        thigh = unit(between(points, f"hip_{side}", f"knee_{side}"))
        shank = unit(between(points, f"knee_{side}", f"ankle_{side}"))
        knees.append(np.sum(np.cross(thigh, shank) * left, axis=-1))
    return _clear(feet), _clear(knees)


def _clear(parts: list[Array]) -> Array:
    values = np.concatenate(parts)
    return values[np.isfinite(values) & (np.abs(np.nan_to_num(values)) > CLEAR)]
