"""Detects a mirrored body, whose feet point backward and knees bend forward, and reflects it.

Toes and knees show forward, the trunk shows up, hips and shoulders show left; in a mirror image these
directions disagree. The cause is left-handed axes read as right-handed, or left and right names swapped; the
points alone cannot tell which. The names were written by a person, but the axes were assumed by a program, so
the names are kept and the body is reflected: points in the plane Y = 0, Euler channels along a level axis of
their file. If the names were wrong instead, the curves of the left leg are those of the right. In an optical
recording in its laboratory's own format, whose axes are right-handed, only the names can be wrong: there, the
sides are exchanged. Bodies whose knees never bend clearly are only flagged. A person whom a sensor sees from
behind all the time, without toes, looks the same; who turns round does not.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.body_points import between, nodes_of
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import to_matrix
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.pipeline.kinematics.vectors import unit
from kinemimic.pipeline.locomotion.leg_pose import is_precise
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.quality.rules.swap_sides import swap_sides

# A foot or knee is counted in a frame where its cosine or sine exceeds this; a straight knee is not evidence.
MIN_EVIDENCE = 0.3
# At least this share of the cases must be mirrored, of at least this many, and feet and knees must agree.
MIN_MIRRORED_SHARE = 0.8
MIN_CASES = 10
# s of clear cases of one knee in which a mirrored body never is itself: hyperextension is shorter.
WHILE = 1.0
_REFLECTION = np.array([1.0, -1.0, 1.0])


def repair(clip: Clip) -> tuple[Clip, list[Defect]]:
    """The clip reflected left to right, or with its sides exchanged, if it is mirrored throughout."""
    feet, knees = foot_and_knee_directions(clip)
    by_feet = len(feet) >= MIN_CASES
    if by_feet and np.mean(feet < 0) < MIN_MIRRORED_SHARE:
        return clip, []
    # Without feet (some marker sets) the knees decide alone, by the same share.
    by_knees = len(knees) >= MIN_CASES
    if by_knees and np.mean(knees < 0) < (0.5 if by_feet else MIN_MIRRORED_SHARE):
        return clip, []
    # Who is seen from behind on the way back only is not mirrored: `seen_from_behind` tells where.
    if not (by_feet or by_knees) or (not by_feet and _is_itself_for_a_while(knees, clip.times)):
        return clip, []
    evidence = (
        *([f"feet point backward in {(feet < 0).sum()} of {len(feet)} clear cases"] if by_feet else []),
        *([f"knees bend forward in {(knees < 0).sum()} of {len(knees)} clear cases"] if by_knees else []),
    )
    found = " and ".join(evidence)
    frames = len(clip.times)
    if not by_knees:
        text = f"{found}, but no knee bends clearly; sitting on the heels looks the same; left as recorded"
        return clip, [Defect("mirrored", frames, "frames", "flagged", text)]
    if clip.provenance.get("reading", {}).get("right_handed") and is_precise(nodes_of(clip)):
        text = f"{found}; the format's axes are right-handed, so left and right names are swapped: exchanged"
        joints, curves = range(len(clip.skeleton.names)), tuple(clip.angles or ())
        exchanged = swap_sides(clip, np.ones(frames, dtype=np.bool_), joints, curves)
        return exchanged, [Defect("mirrored", frames, "frames", "repaired", text)]
    dropped = "; recorded rotations are dropped" if clip.rotations is not None else ""
    # Sensors that take everybody for facing them invent toes that point to the named front.
    from_behind = "" if by_feet else ", as where a sensor sees the person from behind"
    text = (
        f"{found}; reflected left to right, names kept{dropped}; if left and right names are swapped "
        f"instead{from_behind}, each leg's curves are the other's"
    )
    return reflected(clip), [Defect("mirrored", frames, "frames", "repaired", text)]


def reflected(clip: Clip) -> Clip:
    """The mirror image of a clip, left to right, under the same names; without recorded quaternions, which a
    sensor computed for the other side.
    """
    if clip.euler is not None:
        return _reflected_channels(clip)
    skeleton = replace(clip.skeleton, offsets=clip.skeleton.offsets * _REFLECTION)
    positions = clip.positions * _REFLECTION
    return replace(clip, skeleton=skeleton, positions=positions, rotations=None, translations=None)


def _reflected_channels(clip: Clip) -> Clip:
    """Of the frames of all joints one axis of the file is reversed, and each turn about another axis."""
    assert clip.euler is not None and clip.orders is not None and clip.translations is not None  # noqa: S101
    to_world = to_matrix(clip.world_from_file)
    axis = int(np.argmin(np.abs(to_world[2])))  # the most level one: nobody is turned upside down
    mirror = np.ones(3)
    mirror[axis] = -1.0
    turns = [[1.0 if letter == "XYZ"[axis] else -1.0 for letter in order or "XYZ"] for order in clip.orders]
    return replace(
        clip,
        skeleton=replace(clip.skeleton, offsets=clip.skeleton.offsets * mirror),
        positions=clip.positions @ (to_world * mirror @ to_world.T),
        euler=clip.euler * np.array(turns),
        translations=clip.translations * mirror,
        rests=None if clip.rests is None else clip.rests * [*-mirror, 1.0],
        rotations=None,
    )


def foot_and_knee_directions(clip: Clip) -> tuple[Array, Array]:
    """The clear cases of both sides: cosine between toes and forward, and sine of the knee's bend.

    Both are positive for a normal body: toes forward, knees that bend backward.
    """
    points = nodes_of(clip)
    left = between(points, "hip_right", "hip_left")
    left = left + np.nan_to_num(between(points, "shoulder_right", "shoulder_left"))
    up = between(points, "hips", "shoulders")
    # Without shoulders the body is assumed to stand upright.
    up = np.where(np.isfinite(up).all(axis=-1, keepdims=True), up, [0.0, 0.0, 1.0])
    forward = unit(np.cross(left, up))
    left = unit(left)
    feet: list[Array] = []
    knees: list[Array] = []
    for side in SIDES:
        feet.append(np.sum(unit(between(points, f"ankle_{side}", f"foot_{side}")) * forward, axis=-1))
        thigh = unit(between(points, f"hip_{side}", f"knee_{side}"))
        shank = unit(between(points, f"knee_{side}", f"ankle_{side}"))
        knees.append(np.sum(np.cross(thigh, shank) * left, axis=-1))
    return _clear(feet), _clear(knees)


def _is_itself_for_a_while(knees: Array, times: Array) -> bool:
    """Whether the knees bend backward in one of the stretches of a second."""
    size = max(2 * MIN_CASES, round(WHILE / float(np.median(np.diff(times)))))
    stretches = knees[: len(knees) // size * size].reshape(-1, size)
    return bool((np.mean(stretches > 0, axis=1) >= MIN_MIRRORED_SHARE).any())


def _clear(parts: list[Array]) -> Array:
    values = np.concatenate(parts)
    return values[np.isfinite(values) & (np.abs(np.nan_to_num(values)) > MIN_EVIDENCE)]
