"""Bodies of a ZED camera's SDK as JSON, from the layout of Stereolabs' samples (zed-sdk, zed-livelink).

A frame has timestamp (ns) and body_list (or bodies, or bodies/body_list); a body has id, keypoint (x, y, z of
18, 34 or 38 points, as objects or lists) and keypoint_confidence (0 to 100). Frames are a list, or the values
of an object whose keys are their times. Zeros stand for a point without a position. Metres; Y is up in the
samples, down in the SDK's default axes: the head tells. Not tested on a recording.
"""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import Y_UP_TO_Z_UP
from kinemimic.pipeline.kinematics.skeleton import INFERRED, NODES, TRACKED
from kinemimic.pipeline.quality.rules.length_units import SET_BY_USER, UNITS
from kinemimic.pipeline.readers.base.clip_building import clip_of_points, reading
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import refuse_remote
from kinemimic.pipeline.readers.base.json_text import numbers, parse_json
from kinemimic.pipeline.readers.base.node_parents import skeleton_of
from kinemimic.pipeline.readers.base.people import other_people, renumbered
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.clocks.clock import seconds_of
from kinemimic.pipeline.readers.kinect.azure_joints import WORLD_FROM_CAMERA

FORMAT = Format(
    name="ZED bodies JSON",
    sensor="ZED stereo camera",
    holds="positions of 18, 34 or 38 points, any number of people",
    recognised_by='JSON with the keys "keypoint" and "body_list" or "bodies"',
)
# Node -> the number of its point, for each number of points: BODY_18, BODY_34, BODY_38.
POINTS: dict[int, dict[str, int]] = {
    18: {
        "shoulder_center": 1, "shoulder_right": 2, "elbow_right": 3, "wrist_right": 4, "shoulder_left": 5,
        "elbow_left": 6, "wrist_left": 7, "hip_right": 8, "knee_right": 9, "ankle_right": 10, "hip_left": 11,
        "knee_left": 12, "ankle_left": 13,
    },
    34: {
        "hip_center": 0, "spine": 1, "shoulder_center": 3, "shoulder_left": 5, "elbow_left": 6,
        "wrist_left": 7, "hand_left": 8, "shoulder_right": 12, "elbow_right": 13, "wrist_right": 14,
        "hand_right": 15, "hip_left": 18, "knee_left": 19, "ankle_left": 20, "foot_left": 21, "hip_right": 22,
        "knee_right": 23, "ankle_right": 24, "foot_right": 25, "head": 26,
    },
    38: {
        "hip_center": 0, "spine": 2, "shoulder_center": 4, "shoulder_left": 12, "shoulder_right": 13,
        "elbow_left": 14, "elbow_right": 15, "wrist_left": 16, "wrist_right": 17, "hip_left": 18,
        "hip_right": 19, "knee_left": 20, "knee_right": 21, "ankle_left": 22, "ankle_right": 23,
        "foot_left": 24, "foot_right": 25,
    },
}  # fmt: skip
_SURE = 50.0
_MAX_FRAMES = 216_000
_SEARCHED = 2**22


def recognises(source: Source) -> bool:
    """True for JSON that names keypoints of bodies in its first megabytes: nobody may be in view at first."""
    if source.head[0].lstrip()[:1] not in ("{", "["):
        return False
    begin = source.content[:_SEARCHED]
    return b'"keypoint"' in begin and (b'"body_list"' in begin or b'"bodies"' in begin)


def read(source: Source) -> Clip:
    """The clip of the person seen in most frames; others are dropped and counted.

    Raises CaptureError for damaged JSON, and bodies of other points than those of the SDK's formats.
    """
    frames = _frames(parse_json(source), source)
    bodies_of_frames = [_bodies(frame, number, source) for number, frame in enumerate(frames)]
    clock = numbers([frame.get("timestamp") for frame in frames])
    if clock is None or clock.ndim != 1:
        raise source.error(expected="a timestamp in every frame", found="something else")
    people, anew = renumbered(clock, bodies_of_frames, lambda body: body[0])
    count = Counter(number for bodies in people for number in bodies)
    if not count:
        raise source.error(expected="frames with a body", found=f"none in {len(frames)} frames")
    main = count.most_common(1)[0][0]
    size = next(len(bodies[main][0]) for bodies in people if main in bodies)
    points = np.full((len(frames), size, 3), np.nan)
    sure = np.full((len(frames), size), _SURE)
    for number, bodies in enumerate(people):
        if main in bodies:
            place, level = bodies[main]
            if len(place) != size:
                raise source.error(
                    expected=f"{size} points, as before", found=f"{len(place)}", where=f"frame {number}"
                )
            points[number] = place
            sure[number] = _SURE if level is None else level
    times, later, defects, _ = seconds_of(clock, "timestamp", source, lambda frame: f"frame {frame}")
    nodes = tuple(node for node in NODES if node in POINTS[size])
    chosen = [POINTS[size][node] for node in nodes]
    unit = source.unit or "m"
    places = points[later][:, chosen] * UNITS[unit]
    states = np.where(sure[later][:, chosen] >= _SURE, TRACKED, INFERRED).astype(np.uint8)
    neck, ankles = (
        places[:, nodes.index("shoulder_center"), 1],
        places[:, [nodes.index("ankle_left"), nodes.index("ankle_right")], 1].mean(axis=1),
    )
    above = (neck - ankles)[np.isfinite(neck - ankles)]
    down = len(above) > 0 and np.median(above) < 0.0
    return clip_of_points(
        skeleton_of(nodes),
        times,
        places,
        states,
        format=FORMAT,
        reading=reading(
            units=unit,
            units_rule=SET_BY_USER if source.unit else "the format's",
            defects=[*defects, *anew, *other_people([set(bodies) for bodies in people], main)],
            notes=[f"BODY_{size}; Y points {'down' if down else 'up'}"],
        ),
        world_from_file=WORLD_FROM_CAMERA if down else Y_UP_TO_Z_UP,
    )


def _frames(content: Any, source: Source) -> list[dict[str, Any]]:
    """The frames in the order of the file."""
    if isinstance(content, dict):
        inner = next((content[key] for key in ("frames", "data") if isinstance(content.get(key), list)), None)
        content = list(content.values()) if inner is None else inner
    if not isinstance(content, list) or not content or not all(isinstance(one, dict) for one in content):
        raise source.error(expected="a list or an object of frames", found="something else")
    if len(content) > _MAX_FRAMES:
        raise source.error(expected=f"at most {_MAX_FRAMES} frames", found=f"{len(content)}")
    return content


def _bodies(frame: dict[str, Any], number: int, source: Source) -> dict[int, tuple[Array, Array | None]]:
    """Id -> points (18, 34 or 38, 3), NaN where zero, and their confidence, of a frame's bodies."""
    listed = frame.get("body_list", frame.get("bodies"))
    if isinstance(listed, dict):
        listed = listed.get("body_list")
    if listed is None:
        return {}
    if not isinstance(listed, list) or not all(isinstance(body, dict) for body in listed):
        raise source.error(expected="a list of bodies", found="something else", where=f"frame {number}")
    found: dict[int, tuple[Array, Array | None]] = {}
    for body in listed:
        given = body.get("keypoint")
        if isinstance(given, list) and all(isinstance(one, dict) for one in given):
            given = [[one.get(axis) for axis in "xyz"] for one in given]
        points = numbers(given)
        if points is None or points.ndim != 2 or len(points) not in POINTS or points.shape[1] != 3:
            raise source.error(
                expected=f"{', '.join(str(size) for size in POINTS)} points of x, y, z in keypoint",
                found="something else" if points is None else f"{points.shape}",
                where=f"frame {number}",
            )
        places = [f"point {k}" for k in range(len(points))]
        refuse_remote(points[None], places, source, lambda _: f"frame {number}", any_unit=True)
        level = numbers(body.get("keypoint_confidence"))
        identity = body.get("id", 0)
        if not isinstance(identity, int) or identity in found:
            raise source.error(
                expected="an id of each body", found=repr(identity)[:20], where=f"frame {number}"
            )
        points[(points == 0.0).all(axis=1) | ~np.isfinite(points).all(axis=1)] = np.nan
        found[identity] = points, level if level is not None and level.shape == (len(points),) else None
    return found
