"""Tracks of an OpenSim model's bodies as JSON, as OpenCap's visualizer reads and exports them.

An object with time (s) and bodies: name -> rotation, translation of each frame, and geometry that is not
read. A rotation is three angles (radians) about the body's own X, then Y, then Z; a translation is the
origin's (m) in a world with X forward, Y up and Z to the right. The origins of femur, tibia and talus are the
centres of hip, knee and ankle, those of humerus, ulna and hand the centres of shoulder, elbow and wrist.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import from_axis_angle, from_euler
from kinemimic.pipeline.kinematics.skeleton import NODES
from kinemimic.pipeline.readers.base.absolute_orientations import child_to_parent
from kinemimic.pipeline.readers.base.clip_building import clip_of_points, reading
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import MAX_DISTANCE, increasing_times, refuse_remote
from kinemimic.pipeline.readers.base.json_text import numbers, parse_json
from kinemimic.pipeline.readers.base.node_parents import skeleton_of
from kinemimic.pipeline.readers.base.source import Source

FORMAT = Format(
    name="OpenSim bodies JSON",
    sensor="optical or video, through inverse kinematics",
    holds="positions and orientations of a model's bodies",
    recognised_by='a JSON object with the keys "bodies", "rotation" and "translation"',
)
# From X forward, Y up, Z right to X forward, Y left, Z up.
WORLD_FROM_FILE: Array = from_axis_angle("X", 0.5 * np.pi)
# Node -> the bodies in the middle of whose origins it is, and the body whose rotation it has.
_BODIES: dict[str, tuple[tuple[str, ...], str]] = {
    "hip_center": (("femur_l", "femur_r"), "pelvis"),
    "shoulder_center": (("humerus_l", "humerus_r"), "torso"),
    **{
        f"{node}_{side}": ((f"{body}_{side[0]}",), f"{body}_{side[0]}")
        for side in ("left", "right")
        for node, body in (
            ("shoulder", "humerus"), ("elbow", "ulna"), ("wrist", "hand"),
            ("hip", "femur"), ("knee", "tibia"), ("ankle", "talus"), ("foot", "toes"),
        )
    },
}  # fmt: skip
REQUIRED: tuple[str, ...] = tuple(
    f"{body}_{s}" for body in ("femur", "tibia", "talus", "humerus") for s in ("l", "r")
)
_MAX_ANGLE, _MAX_TIME = 100.0, 1e6
_SEARCHED = 2**22


def recognises(source: Source) -> bool:
    """True for a JSON object that names bodies with rotations or translations in its first lines."""
    if not source.head[0].lstrip().startswith("{"):
        return False
    # The times, or the names of geometries, may fill the first lines.
    begin = source.content[:_SEARCHED]
    return b'"bodies"' in begin and (b'"translation"' in begin or b'"attachedGeometries"' in begin)


def read(source: Source) -> Clip:
    """The clip of the nodes at the bodies' origins, with the bodies' rotations.

    Raises CaptureError for damaged JSON, missing legs or arms, and arrays that do not fit each other.
    """
    content = parse_json(source)
    bodies = content.get("bodies") if isinstance(content, dict) else None
    if not isinstance(bodies, dict):
        raise source.error(expected='an object "bodies" of bodies', found=type(bodies).__name__)
    missing = [name for name in REQUIRED if name not in bodies]
    if missing:
        raise source.error(
            expected=f"the bodies {', '.join(REQUIRED)}", found=f"no {', '.join(missing)}"[:200]
        )
    clock = numbers(content.get("time"))
    if clock is None or clock.ndim != 1 or not len(clock) or not (np.abs(clock) < _MAX_TIME).all():
        raise source.error(expected='a list "time" of seconds', found="something else")
    later, defects = increasing_times(clock)
    nodes = tuple(
        node for node in NODES if node in _BODIES and all(name in bodies for name in _BODIES[node][0])
    )
    names = {name for node in nodes for name in (*_BODIES[node][0], _BODIES[node][1])} & bodies.keys()
    places = {
        name: _values(bodies[name], name, "translation", len(clock), MAX_DISTANCE, source) for name in names
    }
    turns = {
        name: from_euler(_values(bodies[name], name, "rotation", len(clock), _MAX_ANGLE, source), "XYZ")
        for name in names
    }
    points = np.stack(
        [np.mean([places[name] for name in _BODIES[node][0]], axis=0) for node in nodes], axis=1
    )
    refuse_remote(points, nodes, source)
    unknown = np.full((len(clock), 4), np.nan)
    frames = np.stack([turns.get(_BODIES[node][1], unknown) for node in nodes], axis=1)
    skeleton = skeleton_of(nodes)
    return clip_of_points(
        skeleton,
        clock[later],
        points[later],
        None,
        format=FORMAT,
        reading=reading(units="m", units_rule="the format's", defects=defects, bodies=len(bodies)),
        world_from_file=WORLD_FROM_FILE,
        rotations=child_to_parent(frames[later], skeleton, WORLD_FROM_FILE),
    )


def _values(body: Any, name: str, key: str, frames: int, most: float, source: Source) -> Array:
    """Three numbers (T, 3) of a body in every frame, checked."""
    values = numbers(body.get(key)) if isinstance(body, dict) else None
    if values is None or values.shape != (frames, 3):
        shape = "something else" if values is None else f"{values.shape}"
        raise source.error(expected=f"{key} of {name} of shape ({frames}, 3), as time", found=shape)
    wrong = ~(np.abs(values) <= most)  # NaN too
    if wrong.any():
        frame, axis = (int(k) for k in np.argwhere(wrong)[0])
        raise source.error(
            expected=f"{key} of {name} of at most {most:g}",
            found=f"{values[frame, axis]:g}",
            where=f"frame {frame}",
        )
    return values
