"""MediaPipe's 33 pose landmarks as JSON. There is no official layout; this reads what its results look like.

`mediapipe_frames` finds the frames. A frame has pose_world_landmarks (or world_landmarks, poseWorldLandmarks,
worldLandmarks, keypoints3D): 33 landmarks of one person, or of several, and the first is read; the landmarks
may be in an object, under "landmark" or "landmarks", or by their names. A landmark is an object with x, y, z,
perhaps visibility (or score) and presence, or a list of these in that order. A frame without a person has an
empty list or null. Image landmarks (pose_landmarks, landmarks) are ignored; if the key does not say which
they are, the size of the body decides (blaze_pose.py). Times or numbers are in the frames, or the rate of the
video ("fps") is beside them.
"""

from __future__ import annotations

import re
from collections import Counter
from json import JSONDecoder
from typing import Any

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.plural import plural
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.readers.base.clip_building import reading
from kinemimic.pipeline.readers.base.column_names import words_of
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import refuse_remote
from kinemimic.pipeline.readers.base.json_text import numbers
from kinemimic.pipeline.readers.base.numbers import to_number
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.clocks.clock import clock_of, is_rate, says_time
from kinemimic.pipeline.readers.clocks.dates import seconds_of_dates
from kinemimic.pipeline.readers.clocks.video_clock import (
    Rate,
    is_frame_number,
    stated_rate,
    times_of_frames,
)
from kinemimic.pipeline.readers.landmarks.blaze_pose import (
    FIT_FOR_USE,
    LANDMARKS,
    NUMBER,
    clip_of_landmarks,
    path_of_landmarks,
)
from kinemimic.pipeline.readers.landmarks.mediapipe_frames import (
    ANY,
    FRAMES,
    IMAGE,
    POSE,
    WORLD,
    listed,
    parse_frames,
)
from kinemimic.pipeline.readers.landmarks.one_person import rows_of_one_person

FORMAT = Format(
    name="MediaPipe landmarks JSON",
    sensor="a video, through MediaPipe",
    holds="positions of 33 landmarks in metres, their visibility",
    recognised_by="JSON with the key pose_world_landmarks, pose_landmarks or a spelling of these, or with x "
    "and visibility",
)
_FIELDS = ("x", "y", "z", "visibility", "presence")
# Names of objects with places, as keys or beside them; so many are joints.
_NAMED = re.compile(r'"([A-Za-z][\w .-]{1,40})"\s*:\s*\{\s*"|"name"\s*:\s*"([\w .-]{1,40})"')
_FEWEST_NAMES = 8


def recognises(source: Source) -> bool:
    """True for JSON that names landmarks of a pose in its first lines, or places with a visibility."""
    head = "".join(source.head)
    if head.lstrip()[:1] not in ("{", "["):
        return False
    keys = [key for key in (*WORLD, *IMAGE) if key != POSE and f'"{key}"' in head]
    if keys and all(key in ANY for key in keys):
        return _lists_landmarks(source.text, keys[0])
    return bool(keys) or ('"x"' in head and '"visibility"' in head and not _names_others(head))


def _names_others(head: str) -> bool:
    """Whether objects have names, as keys or beside their places, that are mostly not MediaPipe's."""
    names = {one for match in _NAMED.finditer(head) for one in match.groups() if one}
    own = sum("_".join(words_of(name)) in NUMBER for name in names)
    return len(names) >= _FEWEST_NAMES and own <= 0.5 * len(LANDMARKS)


def _lists_landmarks(text: str, key: str) -> bool:
    """Whether the first list under a key is of as many landmarks as MediaPipe's, or cannot be told."""
    match = re.search(rf'"{key}"\s*:\s*(?=\[\s*[^\]\s])', text)
    try:
        value, _ = JSONDecoder().raw_decode(text, match.end()) if match else ([], 0)
    except (ValueError, RecursionError):
        return True  # damaged: said when it is read
    if value and isinstance(value[0], list) and value[0] and isinstance(value[0][0], list | dict):
        value = value[0]  # of several people
    return not value or len(value) == len(LANDMARKS)


def read(source: Source) -> Clip:
    """The clip of the nodes that the landmarks give, of one person; without times and frame
    numbers, at 30 Hz.

    Raises CaptureError for damaged JSON, other frames than described above, and image landmarks.
    """
    document, frames = parse_frames(source)
    key = _landmarks_key(frames, source)
    frames = _timed(frames, key)
    values = np.full((len(frames), len(LANDMARKS), len(_FIELDS)), np.nan)
    values[..., 3:] = 1.0
    others = 0
    for number, frame in enumerate(frames):
        found, more = _landmarks(frame.get(key), number, source)
        others += more
        if found is not None:
            values[number, :, : found.shape[1]] = found
    beside = numbers_beside(frames, source)
    rows, people = rows_of_one_person(beside, values[..., :3])
    values = values[rows]
    points = values[..., :3]

    def where(row: int) -> str:
        return f"frame {rows[row]}"

    if not np.isfinite(points).any():
        raise source.error(expected="frames with a person", found=f"none in {len(frames)} frames")
    path = path_of_landmarks(points, source)
    refuse_remote(points, LANDMARKS, source, where)
    beside = {name: given[rows] for name, given in beside.items()}
    times = times_of_frames(len(rows), beside, source, where, rate=rate_beside_frames(document, source))
    defects = [*times.defects, *people]
    if others:
        text = f"more people than one in {plural(others, 'frame')}: the first is read"
        defects.append(Defect("several_people", others, "frames", "repaired", text))
    return clip_of_landmarks(
        points[times.kept],
        values[times.kept, :, 3:].min(axis=-1),
        times.seconds,
        format=FORMAT,
        reading=reading(
            units="m",
            units_rule="the format's",
            defects=defects,
            notes=[times.note, path],
            key=key,
        ),
    )


def _landmarks_key(frames: list[dict[str, Any]], source: Source) -> str:
    """The key of the landmarks: a world list's if a frame has one."""
    for key in (*WORLD, *IMAGE):
        if any(frame.get(key) for frame in frames):
            return key
    raise source.error(
        expected=f"frames with {WORLD[0]}", found="none with a person's landmarks", advice=FIT_FOR_USE
    )


def _timed(frames: list[dict[str, Any]], key: str) -> list[dict[str, Any]]:
    """The frames without those that show nobody and lack the time or number that most frames have."""
    count = Counter(one for frame in frames for one in frame if says_time(one) or is_frame_number(one))
    clocks = [one for one, found in count.items() if 2 * found > len(frames)]
    return [frame for frame in frames if frame.get(key) or all(frame.get(one) is not None for one in clocks)]


def _landmarks(value: Any, number: int, source: Source) -> tuple[Array | None, bool]:
    """Landmarks (33, 3 to 5) of a frame, or None without a person; and whether there are more people."""
    value = listed(value)
    if isinstance(value, list):
        value = [listed(one) for one in value]
    if value is None or value == []:
        return None, False
    several = False
    if isinstance(value, list) and isinstance(value[0], list) and _is_person(value[0]):
        several, value = len(value) > 1, value[0]
    if isinstance(value, list) and all(isinstance(one, dict) for one in value):
        named = [[*(one.get(axis) for axis in "xyz"), _visibility(one), one.get("presence")] for one in value]
        value = [[*one[:3], *(1.0 if level is None else level for level in one[3:])] for one in named]
    found = numbers(value)
    if found is None or found.ndim != 2 or len(found) != len(LANDMARKS) or not 3 <= found.shape[1] <= 5:
        count = f"{len(value)}" if isinstance(value, list) else type(value).__name__
        raise source.error(
            expected=f"{len(LANDMARKS)} landmarks of x, y, z and perhaps visibility and presence",
            found=f"{count} of something else" if count == str(len(LANDMARKS)) else count,
            where=f"frame {number}",
        )
    return found, several


def _is_person(value: list[Any]) -> bool:
    """Whether a list is one of several people, not a landmark's numbers."""
    return bool(value) and isinstance(value[0], dict | list)


def _visibility(landmark: dict[str, Any]) -> Any:
    return landmark.get("visibility", landmark.get("score"))


def numbers_beside(frames: list[dict[str, Any]], source: Source) -> dict[str, Array]:
    """Key -> the numbers (T,) that all frames have in it, seconds for dates, NaN for
    other words; CaptureError if the clock has such words."""
    found: dict[str, Array] = {}
    words: dict[str, str] = {}
    for key in (key for key in frames[0] if all(key in frame for frame in frames)):
        given = [frame[key] for frame in frames]
        if says_time(key) and all(isinstance(value, str) and to_number(value) is None for value in given):
            values = numbers(list(seconds_of_dates(given)))
        else:
            values = numbers([to_number(value) if isinstance(value, str) else value for value in given])
        if values is not None and values.ndim == 1:
            found[key] = values
            if (unknown := np.isnan(values)).any() and isinstance(
                word := given[int(np.argmax(unknown))], str
            ):
                words[key] = word
    if (clock := clock_of(found)) in words:
        raise source.error(expected=f"numbers or dates in {clock}", found=repr(words[clock])[:40])
    return found


def rate_beside_frames(document: Any, source: Source) -> Rate | None:
    """The rate that the file states beside its frames, or in objects there ("metadata"), or None."""
    objects = [document] if isinstance(document, dict) else []
    for one in objects:
        for key, value in one.items():
            if is_rate(key) and value is not None:
                return stated_rate(key, value, source)
            if key not in FRAMES and isinstance(value, dict):
                objects.append(value)
    return None
