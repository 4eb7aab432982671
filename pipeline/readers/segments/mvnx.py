"""Xsens MVNX: the movement that MVN computed from a suit of inertial sensors, as XML.

A frame has the orientation (quaternion, w first, from the segment's axes to the world's) and the position of
the origin, its upper joint, of each of 23 segments, or of the pelvis and the legs alone, in metres; the world
is X forward, Y left, Z up, and so is every segment in the identity pose. Angles of the joints (degrees;
abduction, rotation, flexion) are MVN's own.
"""

from __future__ import annotations

import re

import numpy as np

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.joint_names import joints_by_name
from kinemimic.pipeline.kinematics.rotations import IDENTITY, rotate
from kinemimic.pipeline.kinematics.skeleton import INFERRED, TRACKED, Skeleton
from kinemimic.pipeline.plural import plural
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.readers.base.absolute_orientations import child_to_parent
from kinemimic.pipeline.readers.base.clip_building import clip_of_points, reading
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import increasing_times
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.kinect.kinect_values import check_quaternions
from kinemimic.pipeline.readers.segments.mvnx_chain import NOTE, chain_positions
from kinemimic.pipeline.readers.segments.mvnx_text import Content, parse_mvnx

FORMAT = Format(
    name="Xsens MVNX",
    sensor="inertial suit",
    holds="positions and orientations of 23 segments, joint angles",
    recognised_by="the element <mvnx>",
)
# A path is computed from steps and drifts, but nobody walks further than this (metres).
_MAX_COORDINATE = 1e4
_RATES = (1.0, 1000.0)
# The times are whole milliseconds, of which a rate of 60 Hz makes steps of 16 and 17.
_TIME_DIGITS = 1.1e-3
_ROOT = re.compile(r"<(?:\w+:)?mvnx\b")
_PELVIS = "Pelvis"
# Metres from the pelvis; only its direction counts.
_SPINE = 0.15
# Angle of ours -> MVN's joint; the third of its three angles is the flexion.
_ANGLES: dict[str, str] = {
    f"{joint.lower()}_{side.lower()}": f"j{side}{joint}"
    for joint in ("Knee", "Hip")
    for side in ("Left", "Right")
}


def recognises(source: Source) -> bool:
    """True for XML whose first lines open <mvnx>."""
    return source.head[0].lstrip().startswith("<") and any(map(_ROOT.search, source.head))


def read(source: Source) -> Clip:
    """The clip of the first subject's segments, with rotations if the file has them; the T-pose before the
    movement is left out. Without positions, they are computed from the rotations (mvnx_chain.py).

    angles: the file's own knees and hips. Raises CaptureError for damaged XML, and frames that do not fit the
    segments.
    """
    content = parse_mvnx(source)
    skeleton = _skeleton(content, source)
    count = len(skeleton.names)
    if not content.frames:
        raise source.error(expected='frames of type "normal"', found="none")
    order = [content.segments.index(name) for name in skeleton.names]
    turns = _turns(content, skeleton, order, source)
    notes = []
    if turns is None or any("position" in frame.values for frame in content.frames):
        positions = _positions(content, skeleton, order, source)
    else:
        positions = chain_positions(content, skeleton, turns, source)
        notes.append(NOTE)
    states = None
    if turns is not None and _is_legs(skeleton):
        skeleton, positions, turns = _with_trunk(skeleton, positions, turns)
        states = np.array([*[TRACKED] * count, INFERRED], dtype=np.uint8)
        notes.append("no segments of the trunk: it is assumed upright on the pelvis, as in the calibration")
    times, later, defects = _times(content, source)
    if content.subjects > 1:
        text = f"{plural(content.subjects - 1, 'more subject')} in the file: the first is read"
        defects.append(Defect("several_people", content.subjects - 1, "people", "repaired", text))
    return clip_of_points(
        skeleton,
        times,
        positions[later],
        None if states is None else np.broadcast_to(states, (len(times), count + 1)),
        format=FORMAT,
        reading=reading(
            units="m",
            units_rule="the format's",
            defects=defects,
            notes=notes,
            version=content.version[:20],
            segments=count,
        ),
        world_from_file=IDENTITY,
        rotations=None if turns is None else child_to_parent(turns[later], skeleton, IDENTITY),
        angles=_angles(content, later, source),
    )


def _skeleton(content: Content, source: Source) -> Skeleton:
    """The tree of the segments, parents first, rest offsets unknown (zeros)."""
    names = content.segments
    if not names or len(set(names)) != len(names) or "" in names:
        raise source.error(
            expected="segments with labels of their own", found=", ".join(names)[:60] or "no segments"
        )
    above = {joint.below: joint.above for joint in content.joints}
    unknown = next((name for pair in above.items() for name in pair if name not in names), None)
    if unknown is not None:
        raise source.error(expected="joints between the segments", found=f"one at {unknown[:40]!r}")
    ordered: list[str] = []
    while len(ordered) < len(names):
        ready = [
            name for name in names if name not in ordered and (name not in above or above[name] in ordered)
        ]
        if not ready:
            raise source.error(expected="joints that form a tree", found="a ring of segments")
        ordered += ready
    parents = tuple(ordered.index(above[name]) if name in above else -1 for name in ordered)
    return Skeleton(tuple(ordered), parents, np.zeros((len(ordered), 3)))


def _is_legs(skeleton: Skeleton) -> bool:
    """Whether these are the segments of MVN's lower body alone."""
    found = joints_by_name(skeleton.names)
    return _PELVIS in skeleton.names and not found.keys() & {
        "spine",
        "shoulder_center",
        "head",
        "shoulder_left",
    }


def _with_trunk(skeleton: Skeleton, positions: Array, turns: Array) -> tuple[Skeleton, Array, Array]:
    """The segments, and a spine above the pelvis along its Z, which is upright in the calibration."""
    pelvis = skeleton.names.index(_PELVIS)
    spine = positions[:, pelvis] + rotate(turns[:, pelvis], np.array([0.0, 0.0, _SPINE]))
    return (
        Skeleton(
            (*skeleton.names, "spine"),
            (*skeleton.parents, pelvis),
            np.vstack([skeleton.offsets, np.zeros(3)]),
        ),
        np.concatenate([positions, spine[:, None]], axis=1),
        np.concatenate([turns, turns[:, [pelvis]]], axis=1),
    )


def _positions(content: Content, skeleton: Skeleton, order: list[int], source: Source) -> Array:
    """Positions (T, J, 3) of the segments' origins as MVN computed them."""
    positions = _values(content, "position", 3 * len(order), source).reshape(-1, len(order), 3)[:, order]
    wrong = ~(np.abs(positions) <= _MAX_COORDINATE)  # NaN too
    if wrong.any():
        frame, segment, axis = (int(k) for k in np.argwhere(wrong)[0])
        raise source.error(
            expected=f"metres, at most {_MAX_COORDINATE:g}, at {skeleton.names[segment]}",
            found=f"{positions[frame, segment, axis]:g}",
            line=content.frames[frame].line,
        )
    return positions


def _turns(content: Content, skeleton: Skeleton, order: list[int], source: Source) -> Array | None:
    """Orientations (T, J, 4) of the segments in the world; None if MVN was told to export none."""
    if not any("orientation" in frame.values for frame in content.frames):
        return None
    count = len(order)
    turns = _values(content, "orientation", 4 * count, source).reshape(-1, count, 4)[..., [1, 2, 3, 0]]
    turns = turns[:, order]
    check_quaternions(turns, skeleton.names, lambda frame: f"line {content.frames[frame].line}", source)
    return turns


def _values(content: Content, name: str, width: int, source: Source) -> Array:
    """The numbers (T, width) of an element of every frame."""
    for frame in content.frames:
        found = frame.values.get(name)
        if found is None or len(found) != width:
            raise source.error(
                expected=f"{width} numbers in <{name}>",
                found="none" if found is None else f"{len(found)}",
                line=frame.line,
            )
    return np.array([frame.values[name] for frame in content.frames])


def _times(content: Content, source: Source) -> tuple[Array, Mask, list[Defect]]:
    """Seconds of the frames to keep, their mask (T,), and defects of the clock."""
    given = [frame.time for frame in content.frames]
    try:
        rate = float(content.rate)
    except ValueError:
        rate = 0.0
    stated = _RATES[0] <= rate <= _RATES[1]
    if None in given:
        if not stated:
            raise source.error(
                expected=f"a frameRate of {_RATES[0]:g} to {_RATES[1]:g} Hz, or a time in every frame",
                found=f"{content.rate[:20]!r} and frames without a time",
            )
        return np.arange(len(given)) / rate, np.ones(len(given), dtype=np.bool_), []
    clock = np.array(given, dtype=np.float64) / 1000.0
    if not (np.abs(clock) < 1e9).all():
        bad = int(np.argmax(~(np.abs(clock) < 1e9)))
        raise source.error(
            expected="a time in ms", found=f"{1e3 * clock[bad]:g}", line=content.frames[bad].line
        )
    later, defects = increasing_times(clock)
    times = clock[later]
    regular = times[0] + np.arange(len(times)) / rate if stated else times
    return regular if np.abs(regular - times).max() <= _TIME_DIGITS else times, later, defects


def _angles(content: Content, later: Mask, source: Source) -> dict[str, Array] | None:
    """MVN's own knees and hips (T,) in radians, if the file has them."""
    labels = [joint.label for joint in content.joints]
    if any("jointAngle" not in frame.values for frame in content.frames):
        return None
    values = np.radians(_values(content, "jointAngle", 3 * len(labels), source)[later])
    return {
        name: np.where(np.isfinite(flexion), flexion, np.nan)
        for name, joint in _ANGLES.items()
        if joint in labels
        for flexion in (values[:, 3 * labels.index(joint) + 2],)
    }
