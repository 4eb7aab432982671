"""Azure Kinect body tracking as JSON, as the SDK's offline_processor sample writes it.

Format: microsoft/Azure-Kinect-Samples, body-tracking-samples/offline_processor/main.cpp. One object with
joint_names, bone_list, k4abt_sdk_version, source_file and frames; a frame has timestamp_usec, frame_id,
num_bodies and bodies; a body has body_id and, 32 each, joint_positions (mm) and joint_orientations (w first).
Some recorders write the list of frames alone, or no orientations.
A person that the tracker loses returns under another body_id. The sample does not write the SDK's confidence
of a joint, but some recorders derived from it do.
Joints, axes and the frames of the joints: azure_joints.py.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import TRACKED
from kinemimic.pipeline.readers.base.absolute_orientations import child_to_parent
from kinemimic.pipeline.readers.base.clip_building import clip_of_points, reading
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import refuse_remote
from kinemimic.pipeline.readers.base.json_text import numbers, parse_json
from kinemimic.pipeline.readers.base.people import other_people, renumbered
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.kinect.azure_joints import (
    AZURE_JOINTS,
    OLD_NAMES,
    STATE_OF_CONFIDENCE,
    WORLD_FROM_CAMERA,
    azure_skeleton,
)
from kinemimic.pipeline.readers.kinect.kinect_values import check_quaternions, sensor_clock

FORMAT = Format(
    name="Azure Kinect body tracking JSON",
    sensor="Azure Kinect",
    holds="times, positions and orientations of 32 joints, any number of people",
    recognised_by="JSON with bone_list, joint_positions or k4abt_sdk_version",
)
_MARKS = (
    '"bone_list"',
    '"joint_positions"',
    '"joint_orientations"',
    '"k4abt_sdk_version"',
    '"timestamp_usec"',
)
_CONFIDENCES = ("confidence_levels", "joint_confidences", "joint_confidence")
# Two hours at 30 fps: an empty frame takes few bytes in the file and 2 kB here.
_MAX_FRAMES = 216_000
# Microseconds; larger times are damage, and a float could not hold them exactly.
_MAX_TIME = 2**53
_MM = 1000.0


def recognises(source: Source) -> bool:
    """True if the text begins as JSON and has one of the format's keys in its first lines."""
    head = "".join(source.head)
    return head.lstrip().startswith(("{", "[")) and any(mark in head for mark in _MARKS)


def read(source: Source) -> Clip:
    """The clip of the person seen in most frames, 32 joints, with rotations if the file has orientations, one
    frame per frame of the file.

    Where that person is not seen, every joint is missing. Other people are dropped and counted.
    """
    document = parse_json(source)
    if isinstance(document, list):
        document = {"frames": document}
    frames = document.get("frames") if isinstance(document, dict) else None
    if not isinstance(frames, list) or not frames:
        raise source.error(expected='a list "frames" of body-tracking results', found="none")
    if len(frames) > _MAX_FRAMES:
        raise source.error(expected=f"at most {_MAX_FRAMES} frames", found=f"{len(frames)}")
    order = _order(document.get("joint_names", list(AZURE_JOINTS)), source)
    times = np.array([_time(frame, number, source) for number, frame in enumerate(frames)]) * 1e-6
    later, defects = sensor_clock(times, _where, source)
    bodies_of_frames = [_people(frame, number, source) for number, frame in enumerate(frames)]
    people, anew = renumbered(times, bodies_of_frames, _places)
    seen = Counter(body for bodies in people for body in bodies)
    if not seen:
        raise source.error(expected="a person", found=f"{len(frames)} frames without one")
    # On a tie, the first to appear.
    main_person = seen.most_common(1)[0][0]
    rows = [number for number, bodies in enumerate(people) if main_person in bodies and later[number]]
    bodies = [people[number][main_person] for number in rows]

    points = np.full((len(frames), len(AZURE_JOINTS), 3), np.nan)
    states = np.zeros((len(frames), len(AZURE_JOINTS)), dtype=np.uint8)
    points[rows] = _values(bodies, rows, "joint_positions", 3, source)[:, order] / _MM
    states[rows] = _states(bodies, rows, source)[:, order]
    refuse_remote(points, AZURE_JOINTS, source, unit="mm")
    skeleton, rotations, notes = azure_skeleton(), None, ["no orientations: rotations follow from positions"]
    if any("joint_orientations" in body for body in bodies):
        turns = np.full((len(frames), len(AZURE_JOINTS), 4), np.nan)
        turns[rows] = _values(bodies, rows, "joint_orientations", 4, source)[:, order][..., [1, 2, 3, 0]]
        check_quaternions(turns, AZURE_JOINTS, _where, source)
        rotations, notes = child_to_parent(turns[later], skeleton, WORLD_FROM_CAMERA), []
    return clip_of_points(
        skeleton,
        times[later],
        points[later],
        states[later],
        format=FORMAT,
        reading=reading(
            units="mm",
            units_rule="the format's",
            defects=[*defects, *anew, *other_people(people, main_person)],
            notes=notes,
            sdk=str(document.get("k4abt_sdk_version", ""))[:40],
        ),
        world_from_file=WORLD_FROM_CAMERA,
        rotations=rotations,
    )


def _where(frame: int) -> str:
    return f"frame {frame}"


def _order(names: Any, source: Source) -> list[int]:
    """The index in the file of each of AZURE_JOINTS."""
    names_in_file = names if isinstance(names, list) else []
    found = [OLD_NAMES.get(name, name) for name in names_in_file if isinstance(name, str)]
    if sorted(found) != sorted(AZURE_JOINTS):
        unknown = next((name for name in found if name not in AZURE_JOINTS), None)
        raise source.error(
            expected=f"{len(AZURE_JOINTS)} joint_names of the Azure Kinect, each once",
            found=f"{len(found)} names" + (f", including {unknown[:40]!r}" if unknown else ""),
        )
    return [found.index(joint) for joint in AZURE_JOINTS]


def _time(frame: Any, number: int, source: Source) -> float:
    """The frame's time in microseconds."""
    time = frame.get("timestamp_usec") if isinstance(frame, dict) else None
    if isinstance(time, bool) or not isinstance(time, int | float) or not 0 <= time < _MAX_TIME:
        raise source.error(expected="a timestamp_usec", found=_shown(time), where=_where(number))
    return float(time)


def _people(frame: dict[str, Any], number: int, source: Source) -> dict[int, dict[str, Any]]:
    """The frame's bodies by their body_id."""
    bodies = frame.get("bodies")
    if not isinstance(bodies, list) or not all(isinstance(body, dict) for body in bodies):
        raise source.error(expected='a list "bodies" of objects', found=_shown(bodies), where=_where(number))
    count = frame.get("num_bodies", len(bodies))
    if count != len(bodies):
        raise source.error(
            expected=f"{_shown(count)} bodies, as in num_bodies", found=f"{len(bodies)}", where=_where(number)
        )
    ids = [body.get("body_id", body.get("id")) for body in bodies]
    people = {identity: body for identity, body in zip(ids, bodies, strict=True) if isinstance(identity, int)}
    if len(people) != len(bodies):
        raise source.error(
            expected="a different whole number as body_id for each body",
            found=f"{len(bodies)} bodies with {len(people)} such numbers",
            where=_where(number),
        )
    return people


def _places(body: dict[str, Any]) -> Array | None:
    """The positions (32, 3) of a body, None if it has others."""
    places = numbers(body.get("joint_positions"))
    return places if places is not None and places.shape == (len(AZURE_JOINTS), 3) else None


def _values(
    bodies: Sequence[dict[str, Any]], rows: Sequence[int], key: str, width: int, source: Source
) -> Array:
    """Numbers (len(bodies), 32, width) under that key."""
    shape = (len(AZURE_JOINTS), width)
    values = numbers([body.get(key) for body in bodies])
    if values is not None and values.shape[1:] == shape:
        return values
    for row, body in zip(rows, bodies, strict=True):
        one = numbers(body.get(key))
        if one is None or one.shape != shape:
            size = " x ".join(map(str, one.shape)) if one is not None and one.shape else _shown(body.get(key))
            raise source.error(
                expected=f"{key} of {shape[0]} x {shape[1]} numbers",
                found=size,
                where=_where(row),
            )
    raise source.error(expected=f"{key} of {shape[0]} x {shape[1]} numbers", found="something else")


def _states(bodies: Sequence[dict[str, Any]], rows: Sequence[int], source: Source) -> NDArray[np.uint8]:
    """States (len(bodies), 32) of the joints, from their confidence if the recorder wrote it."""
    key = next((key for key in _CONFIDENCES if key in bodies[0]), None)
    if key is None:
        return np.full((len(bodies), len(AZURE_JOINTS)), TRACKED, dtype=np.uint8)
    levels = numbers([body.get(key) for body in bodies])
    # One recorder writes [2] instead of 2.
    if levels is not None and levels.shape[1:] in ((len(AZURE_JOINTS),), (len(AZURE_JOINTS), 1)):
        levels = levels.reshape(len(bodies), len(AZURE_JOINTS))
        wrong = ~np.isin(levels, np.arange(len(STATE_OF_CONFIDENCE)))
        if not wrong.any():
            return STATE_OF_CONFIDENCE[levels.astype(np.intp)]
        row = int(np.argwhere(wrong)[0][0])
        raise source.error(expected=f"{key} of 0 to 3", found="another value", where=_where(rows[row]))
    raise source.error(expected=f"{key} of {len(AZURE_JOINTS)} numbers in every body", found="something else")


def _shown(value: Any) -> str:
    """A value for a message: a number in short, anything else by its type."""
    if value is None:
        return "none"
    return f"{value}"[:24] if isinstance(value, int | float) else f"a {type(value).__name__}"
