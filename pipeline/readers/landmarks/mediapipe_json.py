"""MediaPipe's 33 pose landmarks as JSON. There is no official layout; this reads what its results look like.

A list of frames, or an object with one ("frames", "results", "data"). A frame has pose_world_landmarks (or
world_landmarks, poseWorldLandmarks, worldLandmarks): 33 landmarks of one person, or of several, and the
first is read; the landmarks may be in an object, under "landmark" or "landmarks". A landmark is an object
with x, y, z, perhaps visibility and presence, or a list of these in that order. A frame without a person has
an empty list or null. Image landmarks (pose_landmarks, landmarks) are ignored; if the key does not say
which they are, the size of the body decides (blaze_pose.py). Times are in the frames, or the rate of the
video ("fps") is beside them.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.plural import plural
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.readers.base.clip_building import reading
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import refuse_remote
from kinemimic.pipeline.readers.base.frame_rate import HIGHEST, LOWEST
from kinemimic.pipeline.readers.base.json_text import numbers, parse_json
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.landmarks.blaze_pose import (
    FIT_FOR_USE,
    LANDMARKS,
    clip_of_landmarks,
    path_of_landmarks,
)
from kinemimic.pipeline.readers.landmarks.video_clock import (
    RATE,
    VideoTimes,
    times_of_clock,
    times_of_rate,
)

FORMAT = Format(
    name="MediaPipe landmarks JSON",
    sensor="a video, through MediaPipe",
    holds="positions of 33 landmarks in metres, their visibility",
    recognised_by="JSON with the key pose_world_landmarks, pose_landmarks or a spelling of these",
)
_WORLD = ("pose_world_landmarks", "poseWorldLandmarks", "world_landmarks", "worldLandmarks")
_IMAGE = ("pose_landmarks", "poseLandmarks", "landmarks")
_FRAMES = ("frames", "results", "data")
_CLOCKS = ("timestamp_ms", "timestampMs", "timestamp_us", "timestamp", "time_ms", "time_s", "time")
# Without underscores, in lower case.
_RATES = ("fps", "videofps", "framerate", "videoframerate")
# Two hours at 30 Hz.
_MAX_FRAMES = 216_000
_FIELDS = ("x", "y", "z", "visibility", "presence")


def recognises(source: Source) -> bool:
    """True for JSON that names landmarks of a pose in its first lines."""
    head = "".join(source.head)
    return head.lstrip()[:1] in ("{", "[") and any(f'"{key}"' in head for key in (*_WORLD, *_IMAGE))


def read(source: Source) -> Clip:
    """The clip of the nodes that the landmarks give; without times, at 30 Hz.

    Raises CaptureError for damaged JSON, other frames than described above, and image landmarks.
    """
    document = parse_json(source)
    frames = _frames(document, source)
    key = _landmarks_key(frames, source)
    values = np.full((len(frames), len(LANDMARKS), len(_FIELDS)), np.nan)
    values[..., 3:] = 1.0
    others = 0
    for number, frame in enumerate(frames):
        found, more = _landmarks(frame.get(key), number, source)
        others += more
        if found is not None:
            values[number, :, : found.shape[1]] = found
    points = values[..., :3]
    if not np.isfinite(points).any():
        raise source.error(expected="frames with a person", found=f"none in {len(frames)} frames")
    path = path_of_landmarks(points, source)
    refuse_remote(points, LANDMARKS, source)
    times = _times(frames, document, source)
    defects = list(times.defects)
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


def _frames(content: Any, source: Source) -> list[dict[str, Any]]:
    if isinstance(content, dict):
        content = next((content[key] for key in _FRAMES if key in content), [content])
    if not isinstance(content, list) or not content:
        raise source.error(expected="a list of frames", found="none")
    if len(content) > _MAX_FRAMES:
        raise source.error(expected=f"at most {_MAX_FRAMES} frames", found=f"{len(content)}")
    wrong = next((k for k, frame in enumerate(content) if not isinstance(frame, dict)), None)
    if wrong is not None:
        raise source.error(
            expected="a frame with landmarks", found=type(content[wrong]).__name__, where=f"frame {wrong}"
        )
    return content


def _landmarks_key(frames: list[dict[str, Any]], source: Source) -> str:
    """The key of the landmarks: a world list's if a frame has one."""
    for key in (*_WORLD, *_IMAGE):
        if any(frame.get(key) for frame in frames):
            return key
    raise source.error(
        expected=f"frames with {_WORLD[0]}", found="none with a person's landmarks", advice=FIT_FOR_USE
    )


def _landmarks(value: Any, number: int, source: Source) -> tuple[Array | None, bool]:
    """Landmarks (33, 3 to 5) of a frame, or None without a person; and whether there are more people."""
    value = _listed(value)
    if isinstance(value, list):
        value = [_listed(one) for one in value]
    if value is None or value == []:
        return None, False
    several = False
    if isinstance(value, list) and isinstance(value[0], list) and _is_person(value[0]):
        several, value = len(value) > 1, value[0]
    if isinstance(value, list) and all(isinstance(one, dict) for one in value):
        named = [[one.get(field) for field in _FIELDS] for one in value]
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


def _listed(value: Any) -> Any:
    """The list in an object {"landmark": [...]}, as protobuf's MessageToDict writes it; else the value."""
    if isinstance(value, dict):
        return next((value[key] for key in ("landmark", "landmarks") if key in value), value)
    return value


def _is_person(value: list[Any]) -> bool:
    """Whether a list is one of several people, not a landmark's numbers."""
    return bool(value) and isinstance(value[0], dict | list)


def _times(frames: list[dict[str, Any]], document: Any, source: Source) -> VideoTimes:
    """The frames' own times if all have one, else those of the rate that the file states."""
    name = next((key for key in _CLOCKS if all(key in frame for frame in frames)), None)
    if name is None or len(frames) < 2:
        rate, key = _rate(document, source)
        known = f"{rate:g} Hz ({key})" if key else f"{rate:g} Hz"
        return times_of_rate(len(frames), rate, f"no time in every frame: {known}")
    clock = numbers([frame[name] for frame in frames])
    if clock is None or clock.ndim != 1:
        raise source.error(expected=f"numbers in {name}", found="something else")
    return times_of_clock(clock, name, source, lambda frame: f"frame {frame}")


def _rate(document: Any, source: Source) -> tuple[float, str]:
    """The rate in Hz that the file states beside its frames, or an object there ("metadata"), and its key;
    RATE and "" if it states none."""
    beside = document if isinstance(document, dict) else {}
    objects = [beside, *(value for value in beside.values() if isinstance(value, dict))]
    for key, value in ((key, value) for one in objects for key, value in one.items()):
        if key.lower().replace("_", "") not in _RATES or value is None:
            continue
        rate = numbers(value)
        if rate is None or rate.ndim or not LOWEST <= rate <= HIGHEST:
            raise source.error(
                expected=f"{LOWEST:g} to {HIGHEST:g} frames per second in {key[:40]}",
                found=repr(value)[:40],
            )
        return float(rate), key
    return RATE, ""
