"""Unit and axes of a table, from the size and posture of the body in it; unit of time, from its clock."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.joint_names import joints_by_name
from kinemimic.pipeline.kinematics.rotations import normalize, rotate
from kinemimic.pipeline.quality.rules.length_units import plausible_units
from kinemimic.pipeline.quality.rules.mirrored_body import MIN_MIRRORED_SHARE
from kinemimic.pipeline.readers.clocks.clock import STEPS, named_unit, says_time
from kinemimic.pipeline.readers.clocks.video_clock import is_frame_number
from kinemimic.pipeline.readers.custom_table.description import LENGTHS, SECONDS

_USUAL_STEP = 1.0 / 30.0  # of a recorder, seconds
# Largest step of numbers that count frames, and are not called so.
_FRAME_STEP = 7
# A unit in a column's name -> a key of SECONDS.
_STATED = {"s": "s", "ms": "ms", "µs": "us", "100ns": "100ns"}
# Thigh plus shank of an adult in metres; decides if no unit gives a plausible leg.
_ADULT_LEG = 0.82
_AXES = "XYZ"
# Mean cosine above which an axis of a joint's frame lies along a bone.
_ALIGNED = 0.9
# Joints from which the direction to others tells where up is, best first; networks' bodies have no head, and
# often no pelvis.
_LOW, _HIGH = ("ankle_{}", "knee_{}", "hip_{}"), ("head", "shoulder_center", "shoulder_{}", "spine")


@dataclass(frozen=True)
class Axes:
    """unit: a key of LENGTHS; up, forward, left: "Y", "-Z" …; left is "" if the axes are right-handed; notes:
    the evidence for each, by key."""

    unit: str
    up: str
    forward: str
    left: str
    notes: dict[str, str]


def axes_of(points: Array, names: Sequence[str]) -> Axes:
    """Unit and axes of points (T, J, 3) of joints with these names; as for a Kinect where unknown."""
    index = joints_by_name(tuple(names))
    positions = {node: points[:, joint] for node, joint in index.items()}
    notes: dict[str, str] = {}
    unit = _unit(positions, notes)
    up = _up(positions)
    if up is None:
        notes["up"] = "please check: no posture in the file tells it"
        up = np.array([0.0, 1.0, 0.0])
    else:
        notes["up"] = "from the feet to the head"
    forward = _forward(positions, up)
    left = ""
    if forward is None:
        notes["forward"] = "please check: the usual viewing direction; it only rotates the view"
        forward = np.roll(up, 1)
    else:
        notes["forward"] = "the direction of the feet"
        right_handed = _right_handed(positions, up)
        if right_handed is not None and not right_handed:
            left = _name(-np.cross(up, forward))
            notes["left"] = "please check: left-handed axes, or names with left and right swapped"
    return Axes(unit, _name(up), _name(forward), left, notes)


def _unit(positions: dict[str, Array], notes: dict[str, str]) -> str:
    legs = [
        _length(positions[a], positions[b]) + _length(positions[b], positions[c])
        for a, b, c in ((f"hip_{s}", f"knee_{s}", f"ankle_{s}") for s in ("left", "right"))
        if {a, b, c} <= positions.keys()
    ]
    leg = float(np.mean(legs)) if legs else np.nan
    if not leg > 0:
        notes["unit"] = "please check"
        return "m"
    fitting_units = plausible_units(leg, LENGTHS)
    nearest = min(LENGTHS, key=lambda unit: abs(np.log(leg * LENGTHS[unit] / _ADULT_LEG)))
    name = fitting_units[0] if fitting_units else nearest
    others = "".join(f", or {leg * LENGTHS[other]:.2f} m in {other}" for other in fitting_units[1:])
    check = "" if len(fitting_units) == 1 else ": please check"
    notes["unit"] = f"gives thigh plus shank of {leg * LENGTHS[name]:.2f} m{others}{check}"
    return name


def _length(start: Array, end: Array) -> float:
    length = np.linalg.norm(end - start, axis=-1)
    seen = length[np.isfinite(length) & (length > 0)]
    return float(np.median(seen)) if len(seen) else np.nan


def _mean(positions: dict[str, Array], start: str, end: str) -> Array | None:
    """Mean of the unit vectors between two nodes, over both sides for names with {}; None if not seen."""
    vectors = []
    for side in ("left", "right"):
        a, b = start.format(side), end.format(side)
        if a in positions and b in positions:
            vectors.append(positions[b] - positions[a])
    if not vectors:
        return None
    joined = np.concatenate(vectors)
    length = np.linalg.norm(joined, axis=-1, keepdims=True)
    seen = (np.isfinite(length) & (length > 0))[:, 0]
    return np.asarray((joined[seen] / length[seen]).mean(axis=0)) if seen.any() else None


def _axis(direction: Array) -> Array:
    """The coordinate axis nearest to a direction."""
    axis = np.zeros(3)
    largest = int(np.argmax(np.abs(direction)))
    axis[largest] = 1.0 if direction[largest] > 0 else -1.0
    return axis


def _name(axis: Array) -> str:
    largest = int(np.argmax(np.abs(axis)))
    return ("" if axis[largest] > 0 else "-") + _AXES[largest]


def _up(positions: dict[str, Array]) -> Array | None:
    for start, end in product(_LOW, _HIGH):
        if (direction := _mean(positions, start, end)) is not None and np.abs(direction).max() > 0.7:
            return _axis(direction)
    return None


def _forward(positions: dict[str, Array], up: Array) -> Array | None:
    direction = _mean(positions, "ankle_{}", "foot_{}")
    if direction is None:
        return None
    level = direction * (up == 0)
    return _axis(level) if np.abs(level).max() > 0.2 else None


def _right_handed(positions: dict[str, Array], up: Array) -> bool | None:
    """Whether forward is left x up, as toes show it; compared per frame, so that turning round does not
    matter, and as clear as where a body counts as mirrored."""
    if not {"hip_left", "hip_right"} <= positions.keys():
        return None
    lateral = positions["hip_left"] - positions["hip_right"]
    agree = []
    for side in ("left", "right"):
        if {f"ankle_{side}", f"foot_{side}"} <= positions.keys():
            toes = positions[f"foot_{side}"] - positions[f"ankle_{side}"]
            agree.append(np.sum(np.cross(lateral, up) * toes, axis=-1))
    if not agree:
        return None
    seen = np.concatenate(agree)
    seen = seen[np.isfinite(seen) & (seen != 0)]
    return None if len(seen) == 0 else bool((seen < 0).mean() < MIN_MIRRORED_SHARE)


def time_unit(times: Array, name: str) -> tuple[str, float] | None:
    """Unit of increasing times (T,) and their median step in seconds; None if they are not times.

    Whole numbers with steps of 1 to 7 are frame numbers, with a step of 0, unless the column's name says
    that they are times; so are any whole numbers if it says that.
    """
    steps = np.diff(times[np.isfinite(times)])
    if len(steps) < 2 or (steps < 0).mean() > 0.02 or (steps > 0).mean() < 0.4:
        return None
    step = float(np.median(steps[steps > 0]))
    whole_numbers = bool(np.all(np.mod(steps, 1.0) == 0.0))
    if whole_numbers and (is_frame_number(name) or (step <= _FRAME_STEP and not says_time(name))):
        return "frame", 0.0
    stated = _STATED.get(named_unit(name) or "")
    fitting = [u for u in SECONDS if u != "frame" and STEPS[0] <= step * SECONDS[u] <= STEPS[1]]
    if not fitting:
        return ("frame", 0.0) if whole_numbers and step <= _FRAME_STEP else None
    best = (
        stated
        if stated in fitting
        else min(fitting, key=lambda u: abs(np.log(step * SECONDS[u] / _USUAL_STEP)))
    )
    return best, step * SECONDS[best]


def quaternion_order(q: Array, points: Array, parents: Sequence[int]) -> tuple[str, bool | None, str]:
    """Component order of quaternions (T, J, 4), whether they are relative to the world if known, and why.

    parents: (J,) index of each joint's parent, -1 for none. A Kinect's joint frames have +Y along the bone
    that ends at the joint, in camera axes: if one order gives that, order and frame are certain.
    """
    joints = [joint for joint, parent in enumerate(parents) if parent >= 0]
    bones = points[:, joints] - points[:, [parents[joint] for joint in joints]]
    with np.errstate(invalid="ignore", divide="ignore"):
        bones = normalize(bones)
        for order, components in (("xyzw", [0, 1, 2, 3]), ("wxyz", [1, 2, 3, 0])):
            along = np.sum(
                rotate(normalize(q[:, joints][..., components]), np.array([0.0, 1.0, 0.0])) * bones, axis=-1
            )
            if joints and np.isfinite(along).any() and np.nanmean(along) > _ALIGNED:
                return order, True, "+Y lies along the bones, as in a Kinect's frames"
    largest = np.nan_to_num(np.abs(q)).mean(axis=(0, 1))
    order = "wxyz" if largest[0] > largest[3] else "xyzw"
    return order, None, "please check: the largest component is taken as w"
