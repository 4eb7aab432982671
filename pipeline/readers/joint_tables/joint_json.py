"""JSON of joints, whatever its keys are called: laid out as a joint table, and read as one.

A frame is an object, or a list, with joints somewhere within: by their names as keys, as objects with a name
("JointType": "KneeLeft"), or listed in a known order, or in that of a list of names beside the frames; each
with x, y and z, perhaps in an inner object ("Position"), or as three numbers. Frames are a list, a line each,
or the values of an object. Every person of a frame is a row of the table.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

from kinemimic.pipeline.errors import NotACaptureError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.joint_names import REQUIRED, joints_by_name
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.json_text import parse_json
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.clocks.clock import says_time
from kinemimic.pipeline.readers.clocks.video_clock import Rate, is_frame_number
from kinemimic.pipeline.readers.custom_table.suggest_names import joints_of_header
from kinemimic.pipeline.readers.custom_table.suggest_orders import ORDERS
from kinemimic.pipeline.readers.joint_tables import joint_table
from kinemimic.pipeline.readers.joint_tables.listed_joints import (
    Listed,
    joint_names,
    listed_joints,
    with_names,
)
from kinemimic.pipeline.readers.landmarks.mediapipe_frames import numbered, one_document
from kinemimic.pipeline.readers.landmarks.mediapipe_json import numbers_beside, rate_beside_frames
from kinemimic.pipeline.readers.landmarks.one_person import is_person, rows_of_one_person
from kinemimic.pipeline.readers.landmarks.unnamed_joints import clip_of_unnamed

FORMAT = Format(
    name="joint JSON",
    sensor="unknown",
    holds="positions of joints with known names, or in a known order",
    recognised_by="JSON with the names of hips, knees and ankles, or with joints, keypoints, poses, "
    "positions, points, frames or a motion",
)
_SEARCHED = 2**22
_STRING = re.compile(rb'"([A-Za-z][\w .:-]{1,40})"')
# JSON without names has its joints under one of these, or in these (node-kinect2). OpenPose writes an empty
# list of joints in three dimensions beside those of a picture.
_JOINTS = re.compile(
    rb'"(?:(?:joint|skeleton|keypoint|kpt|pose|position|point|frame|motion)s?(?:_?3d)?|cameraX)"\s*:'
    rb'|"pose_keypoints_3d"\s*:\s*\[\s*[^\]\s]',
    re.IGNORECASE,
)
# Keys of what a joint is called, and of its place in a picture, which is left out.
_NAMES = frozenset(("jointtype", "jointname", "jointid", "joint", "name", "type", "label", "bodypart", "id"))
_PICTURE = frozenset(
    ("projection", "proj", "color", "depth", "pixel", "image", "screen", "colorspace", "depthspace")
)
_CAMERA = re.compile(r"(?:camera|world|pos(?:ition)?)[ _]?([xyz])", re.IGNORECASE)
# Numbers in the smallest body, and columns of the largest table.
_FEWEST_NUMBERS, _MOST_COLUMNS = 24, 5000
_MOST_FRAMES = 216_000
_ORDERED = frozenset(map(len, ORDERS.values()))
# Objects around the frames.
_MOST_AROUND = 3
_PERSON = "body_id"
_FRAME = "frame"
# Keys of a time of ROS 1, of OpenPTrack and of ROS 2.
_STAMPS = (("secs", "nsecs"), ("sec", "nsec"), ("sec", "nanosec"))


def recognises(source: Source) -> bool:
    """True for JSON that names joints of legs in its first megabytes, or says that it holds joints."""
    if source.head[0].lstrip()[:1] not in ("{", "["):
        return False
    begin = source.content[:_SEARCHED]
    if _JOINTS.search(begin):
        return True
    names = tuple({name.decode() for name in _STRING.findall(begin)})
    if len(names) > _MOST_COLUMNS:
        return False
    return name_legs(names) or name_legs(joints_of_header(names))


def read(source: Source) -> Clip:
    """The clip of the joints, as of a joint table; CaptureError where these are not certain."""
    return clip_of_document(parse_json(one_document(source)), source, FORMAT)


def clip_of_document(document: Any, source: Source, format: Format) -> Clip:
    """`read`, for objects, lists, numbers and words that are parsed already, of a file in some format."""
    rows = _with_numbers(
        [(number, row) for number, frame in _frames(document, source) for row in _rows(frame)]
    )
    if (names := joint_names(document)) is not None:
        rows = with_names(rows, names)
    columns = list(dict.fromkeys(name for row in rows for name in row))
    if not 3 * len(REQUIRED) <= len(columns) <= _MOST_COLUMNS:
        raise _unknown(columns, source)
    rate = rate_beside_frames(document, source)
    listed = None if name_legs(joints_of_header(tuple(columns))) else listed_joints(rows)
    cells = ("\t".join(str(row.get(name, "")) for name in columns) for row in rows)
    table = source.with_text("\n".join(["\t".join(columns), *cells]) + "\n")
    # A sensor's order within a list of more joints is none: it leaves numbers over.
    if (listed is None or listed.points.shape[1] in _ORDERED) and joint_table.recognises(table):
        return joint_table.clip_of_table(table, format, rate)
    if listed is None:
        raise _unknown(columns, source)
    return _clip_of_listed(listed, rows, source, format, rate)


def _unknown(columns: Sequence[str], source: Source) -> NotACaptureError:
    return NotACaptureError(
        source.path,
        expected="frames with joints that have known names, or are in a known order",
        found=f"{', '.join(columns[:4])[:100]} …" if columns else "none",
        advice="save it as CSV and describe its columns (`kinemimic inspect --suggest` drafts that)",
    )


def _clip_of_listed(
    listed: Listed, rows: Sequence[Mapping[str, Any]], source: Source, format: Format, rate: Rate | None
) -> Clip:
    """The clip of the person who is in most rows."""
    others = [{key: cell for key, cell in row.items() if key not in listed.columns} for row in rows]
    beside = numbers_beside(others, source)
    own, people = rows_of_one_person(beside, listed.points)
    return clip_of_unnamed(
        listed.points[own],
        listed.visibility[own],
        source,
        format=format,
        beside={name: given[own] for name, given in beside.items()},
        rate=rate,
        defects=people,
    )


def name_legs(names: Iterable[str]) -> bool:
    """Whether these are, among others, the names of hips, knees and ankles."""
    return joints_by_name(tuple(names)).keys() >= set(REQUIRED)


def _with_numbers(rows: Sequence[tuple[int, dict[str, Any]]]) -> list[dict[str, Any]]:
    """The rows of somebody; with the numbers of their frames if these do not follow one another, and
    no clock says so."""
    found = [(number, row) for number, row in rows if row]
    steps = {after - before for (before, _), (after, _) in pairwise(found)}
    if steps <= {1} or any(says_time(name) or is_frame_number(name) for name in found[0][1]):
        return [row for _, row in found]
    return [{_FRAME: number, **row} for number, row in found]


def _frames(document: Any, source: Source) -> list[tuple[int, Any]]:
    """The frames with their numbers, or places in the list."""
    content = document
    for _ in range(_MOST_AROUND):
        if not isinstance(content, dict):
            break
        by_number = numbered(content) or []
        if len(by_number) > 1 and not _has_frames(by_number[0][1], len(by_number)):
            content = by_number
            break
        inner: Any = max(_lists(content), key=len, default=None)
        if inner is None:
            wrapped = [value for value in content.values() if isinstance(value, dict)]
            # Of several objects, one around a list holds the frames; else they are the frames.
            around = wrapped if len(wrapped) == 1 else [value for value in wrapped if any(_lists(value))]
            if len(around) != 1:
                content = wrapped
                break
            inner = around[0]
        content = inner
    if not isinstance(content, list) or not content:
        raise NotACaptureError(source.path, expected="a list of frames", found="none")
    if len(content) > _MOST_FRAMES:
        raise source.error(expected=f"at most {_MOST_FRAMES} frames", found=f"{len(content)}")
    return content if isinstance(content[0], tuple) else list(enumerate(content))


def _has_frames(value: Any, others: int) -> bool:
    """Whether a value among `others` is itself a list of frames, of one of several people."""
    return isinstance(value, list) and len(value) > others and len(dict(_cells(value[0]))) >= _FEWEST_NUMBERS


def _lists(value: dict[str, Any]) -> Iterator[list[Any]]:
    """The lists of objects or lists in an object."""
    for one in value.values():
        if isinstance(one, list) and len(one) > 1 and isinstance(one[0], dict | list):
            yield one


def _rows(frame: Any) -> Iterator[dict[str, Any]]:
    """Name of a column -> number or word, for each body of a frame."""
    bodies = _bodies(frame)
    if bodies is None:
        yield dict(_cells(frame))
        return
    key, people = bodies
    common = dict(_cells({name: value for name, value in frame.items() if name != key})) if key else {}
    for place, body in enumerate(people):
        cells = dict(_cells(body))
        if len(cells) >= _FEWEST_NUMBERS:
            own = next((name for name in cells if name.lower() == "id" or is_person(name)), None)
            yield {_PERSON: cells.pop(own) if own else place, **common, **cells}


def _bodies(frame: Any) -> tuple[str, list[Any]] | None:
    """The list of bodies in a frame, and its key; none if the frame is nothing but that list."""
    if isinstance(frame, list):
        frame = {"": frame}
    if not isinstance(frame, dict):
        return None
    for key, value in frame.items():
        bodies = value if isinstance(value, list) and all(isinstance(one, dict) for one in value) else []
        if any(len(dict(_cells(one))) >= _FEWEST_NUMBERS for one in bodies):
            return key, bodies
    return None


def _cells(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """The numbers and words within a value, by the way to them: "joints.KneeLeft.Position.X"."""
    if isinstance(value, bool) or value is None:
        return
    if isinstance(value, int | float | str):
        yield path or "value", " ".join(value.split()) if isinstance(value, str) else value
    elif isinstance(value, list):
        value = _place_of_matrix(value) or value
        axes = "xyzw" if len(value) in (3, 4) and all(_is_number(one) for one in value) else ""
        for place, one in enumerate(value):
            yield from _cells(one, _joined(path, axes[place] if axes else _name(one) or f"{place}"))
    elif isinstance(value, dict) and (stamp := _stamp(value)) is not None:
        yield _joined(path, "time"), stamp
    elif isinstance(value, dict):
        for key, one in value.items():
            if key.lower() in _PICTURE or (path and key.lower() in _NAMES and isinstance(one, str)):
                continue
            camera = _CAMERA.fullmatch(key)
            yield from _cells(one, _joined(path, camera[1].lower() if camera else key))


def _stamp(value: dict[str, Any]) -> float | None:
    """The seconds of a time of ROS, which are two whole numbers."""
    parts = tuple(value.values())
    if tuple(value) not in _STAMPS or not all(_is_number(part) and 0 <= part < 2**63 for part in parts):
        return None
    return float(parts[0] + 1e-9 * parts[1])


def _place_of_matrix(value: list[Any]) -> list[Any] | None:
    """The place in a matrix (4, 4) of a joint, as ARKit and game engines have it, by columns or by rows."""
    flat = [cell for line in value if isinstance(line, list) for cell in line] or value
    if len(flat) != 16 or not all(map(_is_number, flat)):
        return None
    for place, others in ((flat[12:15], flat[3::4]), (flat[3:15:4], flat[12:])):
        if others == [0, 0, 0, 1]:
            return place
    return None


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _name(joint: Any) -> str | None:
    """What a joint in a list is called."""
    if not isinstance(joint, dict):
        return None
    found = (value for key, value in joint.items() if key.lower() in _NAMES and isinstance(value, str))
    return next(found, None)


def _joined(path: str, key: str) -> str:
    key = " ".join(key.split())
    return f"{path}.{key}" if path else key
