"""Bodies of the SMPL family in JSON: those that EasyMocap fits to cameras, and arrays named as in AMASS.

A frame holds people, each with parameters; frames are a list, a line each, or a file each (frame_files.py).
Or one object holds the arrays of all frames. The names and shapes of the arrays: smpl_arrays.py.

EasyMocap's poses (1, 72, 78 or 87) turn the joints, with zeros for the root, or without it (1, 69). Rh
(1, 3), an axis-angle vector, then turns the body about the origin of its model, which is in the trunk, and
Th (1, 3) moves it, in metres (https://github.com/zju3dv/EasyMocap/blob/master/doc/02_output.md).
"""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import NotACaptureError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import from_rotvec, multiply, rotate, to_rotvec
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.json_text import numbers, parse_json
from kinemimic.pipeline.readers.base.people import other_people
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.landmarks.mediapipe_frames import one_document
from kinemimic.pipeline.readers.landmarks.mediapipe_json import rate_beside_frames
from kinemimic.pipeline.readers.landmarks.one_person import is_person
from kinemimic.pipeline.readers.landmarks.video_clock import is_frame_number
from kinemimic.pipeline.readers.segments.smpl_arrays import BODY, COUNTS, SmplArrays, smpl_arrays, turns
from kinemimic.pipeline.readers.segments.smpl_clip import (
    RATE,
    SmplMotion,
    clip_of_motion,
    require_path,
    require_turns,
)

FORMAT = Format(
    name="SMPL JSON",
    sensor="cameras, through a body model",
    holds="rotations of the 22 joints of an SMPL body, and its path",
    recognised_by="JSON with Rh, Th and poses, or with poses (or global_orient and body_pose) and trans",
)
_EASYMOCAP = SmplArrays(("Rh", "poses"), "Th")
# Joints in EasyMocap's poses: without the root, then with it; 26 and 29 with hands and face in few numbers.
_ROOTLESS, _ROOTED = (21, 23), (BODY, 24, 26, 29, 52, 55)
# The pelvis in the models' own axes, m, X left, Y up, Z forward: the means of SMPL and of SMPL-X.
_PELVIS, _PELVIS_X = (-0.002, -0.223, 0.028), (0.003, -0.351, 0.012)
_JOINTS_X = (29, 55)  # in the poses of SMPL-X
_SEARCHED = 2**22
_KEY = re.compile(rb'"([A-Za-z]\w{0,30})"\s*:')
_MOST_FRAMES = 216_000


@dataclass(frozen=True)
class _Row:
    """Parameters of a person in a frame, or in all frames of an object. number: of the frame."""

    number: float
    person: int
    arrays: dict[str, Array]


def recognises(source: Source) -> bool:
    """True for JSON with the names of these arrays, the first of which has a number of values that fits."""
    if source.head[0].lstrip()[:1] not in ("{", "["):
        return False
    names = _names({key.decode() for key in _KEY.findall(source.content[:_SEARCHED])})
    return names is not None and _shaped(_first(source, names.rotations[-1]), _counts(names)) is not None


def read(source: Source) -> Clip:
    """The motion, as `amass.read`; of several people, the one who is in most frames."""
    document = parse_json(one_document(source))
    names, rows = _rows(document, source)
    own, people = _of_one_person(rows)
    arrays = {name: _stacked([row.arrays[name] for row in own], name, source) for name in _of(names)}
    frames = len(arrays[names.path])
    path = arrays[names.path].reshape(frames, 3)
    if names == _EASYMOCAP:
        turned, path = _from_easymocap(arrays, path, source)
    else:
        turned = turns(arrays, names, source)
    stated = rate_beside_frames(document, source)
    rate = RATE if stated is None else stated.hertz
    numbered = np.array([row.number for row in own]) if len(own) == frames else np.arange(frames)
    motion = SmplMotion(
        turned=turned,
        path=path,
        times=(numbered - numbered[0]) / rate,
        rate=rate,
        gender="neutral",
        names=(names.rotations[-1], names.path),
    )
    notes = [] if stated is not None else [f"no rate in the file: {RATE:g} Hz"]
    return clip_of_motion(motion, source, FORMAT, notes=notes, defects=people, arrays=sorted(arrays))


def _names(keys: set[str]) -> SmplArrays | None:
    return _EASYMOCAP if keys.issuperset(_of(_EASYMOCAP)) else smpl_arrays(keys)


def _of(names: SmplArrays) -> tuple[str, ...]:
    return (*names.rotations, names.path)


def _counts(names: SmplArrays) -> tuple[int, ...]:
    """Numbers of joints that the last of the rotations may have."""
    if names == _EASYMOCAP:
        return (*_ROOTLESS, *_ROOTED)
    return COUNTS if len(names.rotations) == 1 else tuple(count - 1 for count in COUNTS)


def _first(source: Source, name: str) -> Any:
    """The first value of a key, None if it is no JSON."""
    key = re.search(rf'"{name}"\s*:\s*', source.text)
    try:
        return json.JSONDecoder().raw_decode(source.text, key.end())[0] if key else None
    except (ValueError, RecursionError):
        return None


def _shaped(value: Any, counts: tuple[int, ...]) -> Array | None:
    """Vectors (T, J, 3) or matrices (T, J, 3, 3), J one of `counts`, T = 1 for those of one frame; None for
    anything else."""
    array = numbers(value)
    if array is None or not array.size or array.ndim > 4:
        return None
    matrices = array.shape[-2:] == (3, 3) and (array.ndim > 2 or counts == (1,))
    last = (3, 3) if matrices else (3,)
    joints, rest = divmod(array.size, int(np.prod(last)))
    if rest:
        return None
    if joints in counts:
        return array.reshape(1, joints, *last)
    each, rest = divmod(joints, len(array))
    return None if rest or each not in counts else array.reshape(len(array), each, *last)


def _rows(document: Any, source: Source) -> tuple[SmplArrays, list[_Row]]:
    """The names of the arrays, and the parameters of everybody in all frames."""
    found = list(_people(document))
    names = next((names for *_, names in found), None)
    if names is None or len(found) > _MOST_FRAMES:
        raise NotACaptureError(
            source.path,
            expected=f"at most {_MOST_FRAMES} frames with parameters of an SMPL body",
            found=f"{len(found)}",
        )
    counts = dict.fromkeys(_of(names), (1,)) | {names.rotations[-1]: _counts(names)}
    rows = []
    for number, person, parameters, _ in found:
        arrays: dict[str, Array] = {}
        for name in counts:
            array = _shaped(parameters.get(name), counts[name])
            if array is None:
                raise source.error(
                    expected=_expected(names, name),
                    found=f"{parameters.get(name)!r}"[:40],
                    where=f"frame {number:g}",
                )
            arrays[name] = array
        rows.append(_Row(number, person, arrays))
    return names, rows


def _expected(names: SmplArrays, name: str) -> str:
    if name == names.path:
        return f"x, y and z in {name}"
    if name != names.rotations[-1]:
        return f"an axis-angle vector in {name}"
    return f"axis-angle vectors of {', '.join(map(str, _counts(names)))} joints in {name}"


def _people(document: Any) -> Iterator[tuple[float, int, dict[str, Any], SmplArrays]]:
    """Number of the frame, number of the person, parameters and their names."""
    content = document
    if isinstance(content, dict) and _names(set(content)) is None:
        content = max((one for one in content.values() if isinstance(one, list)), key=len, default=[])
    for place, frame in enumerate(content if isinstance(content, list) else [content]):
        number = _number(frame, is_frame_number, place)
        for order, person in enumerate(_in_frame(frame)):
            if (names := _names(set(person))) is not None:
                yield (
                    number,
                    int(_number(person, lambda key: key == "id" or is_person(key), order)),
                    person,
                    names,
                )


def _in_frame(frame: Any) -> list[dict[str, Any]]:
    """The people of a frame: itself, its list, or the list in it."""
    if isinstance(frame, dict):
        if _names(set(frame)) is not None:
            return [frame]
        frame = next((one for one in frame.values() if isinstance(one, list)), [])
    return [one for one in frame if isinstance(one, dict)] if isinstance(frame, list) else []


def _number(value: Any, named: Any, otherwise: int) -> float:
    """The number of a frame or a person in an object, under a key that is `named` so."""
    if isinstance(value, dict):
        for key, one in value.items():
            if isinstance(one, int) and not isinstance(one, bool) and 0 <= one < 2**53 and named(key.lower()):
                return float(one)
    return float(otherwise)


def _of_one_person(rows: list[_Row]) -> tuple[list[_Row], list[Defect]]:
    """The rows of the person in most frames, in the order of the frames; a defect for the others."""
    main = Counter(row.person for row in rows).most_common(1)[0][0]
    seen: dict[float, set[int]] = {}
    for row in rows:
        seen.setdefault(row.number, set()).add(row.person)
    own = {row.number: row for row in rows if row.person == main}
    return [own[number] for number in sorted(own)], list(other_people(list(seen.values()), main))


def _stacked(arrays: list[Array], name: str, source: Source) -> Array:
    shapes = {array.shape[1:] for array in arrays}
    if len(shapes) > 1:
        found = " and ".join(map(str, sorted(shapes)))
        raise source.error(expected=f"{name} of one shape in all frames", found=found)
    return np.concatenate(arrays)


def _from_easymocap(arrays: dict[str, Array], path: Array, source: Source) -> tuple[Array, Array]:
    """Turns (T, 22, 3) and the pelvis' path (T, 3): that of a body that turns about the model's origin."""
    for name in _EASYMOCAP.rotations:
        require_turns(arrays[name], name, source)
    require_path(path, _EASYMOCAP.path, source)
    poses, count = arrays["poses"], arrays["poses"].shape[1]
    turn = from_rotvec(arrays["Rh"][:, 0])
    turned = np.zeros((len(poses), BODY, 3))
    turned[:, 1:] = poses[:, : BODY - 1] if count in _ROOTLESS else poses[:, 1:BODY]
    root = turn if count in _ROOTLESS else multiply(turn, from_rotvec(poses[:, 0]))
    turned[:, 0] = to_rotvec(root)
    pelvis = np.array(_PELVIS_X if count in _JOINTS_X else _PELVIS)
    return turned, path + rotate(turn, np.broadcast_to(pelvis, path.shape))
