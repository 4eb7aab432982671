"""The frames of MediaPipe's JSON, whatever the program that saved them puts around them.

A list of frames, an object of frames by their numbers ("12", "frame_0012"), an object with either ("frames",
"results", "data"), or a frame in each line. A frame is an object, perhaps with its landmarks in "pose", or in
the people of "poses" or "people"; or nothing but the list of its landmarks, or people.
"""

from __future__ import annotations

import re
from typing import Any

from kinemimic.pipeline.readers.base.column_names import words_of
from kinemimic.pipeline.readers.base.json_text import parse_json
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.landmarks.blaze_pose import LANDMARKS, NUMBER

# The keys of world landmarks, the last of which are used for the joints of other networks, too; and of those
# that may be image landmarks; "pose" may be an object of these.
ANY = ("keypoints3D", "keypoints_3d")
WORLD = ("pose_world_landmarks", "poseWorldLandmarks", "world_landmarks", "worldLandmarks", *ANY)
POSE = "pose"
IMAGE = ("pose_landmarks", "poseLandmarks", "landmarks", POSE)
_PEOPLE = ("poses", "people")
FRAMES = ("frames", "results", "data")
_PACKED = ("landmark", "landmarks")
_NUMBERED = re.compile(r"\D*(\d{1,9})")
# Two hours at 30 Hz.
_MAX_FRAMES = 216_000


def parse_frames(source: Source) -> tuple[Any, list[dict[str, Any]]]:
    """The document, and its frames; one that is known by its number has it under "frame".

    Raises CaptureError for damaged JSON, and for other frames than described above.
    """
    document = parse_json(one_document(source))
    content = document
    if isinstance(content, dict):
        content = next((content[key] for key in FRAMES if key in content), content)
    if isinstance(content, dict):
        content = _by_number(content) or [content]
    if not isinstance(content, list) or not content:
        raise source.error(expected="a list of frames", found="none")
    if len(content) > _MAX_FRAMES:
        raise source.error(expected=f"at most {_MAX_FRAMES} frames", found=f"{len(content)}")
    frames = [_frame(one) for one in content]
    for number, frame in enumerate(frames):
        if not isinstance(frame, dict):
            raise source.error(
                expected="a frame with landmarks", found=type(frame).__name__, where=f"frame {number}"
            )
    return document, frames


def listed(value: Any) -> Any:
    """The list in an object {"landmark": [...]}, as protobuf's MessageToDict writes it, or of landmarks by
    their names or numbers; else the value."""
    if not isinstance(value, dict) or not value or "x" in value:
        return value
    packed = next((value[key] for key in _PACKED if key in value), None)
    if packed is not None or len(value) > len(LANDMARKS):
        return value if packed is None else packed
    found = {_number(key): one for key, one in value.items()}
    if None in found or len(found) != len(value):
        return value
    example = next(iter(found.values()))
    unseen: Any = [None] * len(example) if isinstance(example, list) else {}
    return [found.get(number, unseen) for number in range(len(LANDMARKS))]


def one_document(source: Source) -> Source:
    """Lines that are an object each as a list of as many lines; else the source."""
    if len(source.head) < 2 or not all(line.lstrip().startswith("{") for line in source.head[:2]):
        return source
    if not source.head[0].rstrip().endswith("}"):
        return source
    lines = [f"{line}," if line.strip() else line for line in source.text.rstrip().split("\n")]
    return source.with_text("[" + "\n".join(lines)[:-1] + "]")


def numbered(content: dict[str, Any]) -> list[tuple[int, Any]] | None:
    """The numbers and values of an object whose keys are all numbered ("12", "frame_0012"), in their order;
    None for another object."""
    found = {key: _NUMBERED.fullmatch(key) for key in content}
    numbers = {key: int(match[1]) for key, match in found.items() if match is not None}
    if not numbers or len(numbers) < len(content):
        return None
    return [(numbers[key], content[key]) for key in sorted(content, key=numbers.__getitem__)]


def _by_number(content: dict[str, Any]) -> list[Any] | None:
    """The frames of an object whose keys are all numbered; None for another object."""
    found = numbered(content)
    if found is None:
        return None
    frames = [(number, _frame(value)) for number, value in found]
    return [{"frame": number, **frame} if isinstance(frame, dict) else frame for number, frame in frames]


def _frame(value: Any) -> Any:
    """The object of a frame, with its landmarks beside its other keys; else the value."""
    if value is None:
        return {}
    if isinstance(value, list):
        return _of_people(value) or {"landmarks": value}
    if not isinstance(value, dict):
        return value
    pose = value.get(POSE)
    inner = {key: pose[key] for key in (*WORLD, *IMAGE) if key in pose} if isinstance(pose, dict) else {}
    people: list[Any] = next((value[key] for key in _PEOPLE if isinstance(value.get(key), list)), [])
    return {**value, **inner, **_of_people(people)}


def _of_people(people: list[Any]) -> dict[str, list[Any]]:
    """Key -> the landmarks of each person, from the people of a frame."""
    found = [one for one in people if isinstance(one, dict)]
    return {key: given for key in (*WORLD, *IMAGE) if (given := [one[key] for one in found if one.get(key)])}


def _number(key: str) -> int | None:
    """The landmark that a key names or numbers."""
    words = words_of(key)
    if len(words) == 1 and words[0].isdecimal():
        number = int(words[0][:3])
        return number if number < len(LANDMARKS) else None
    return NUMBER.get("_".join(words))
