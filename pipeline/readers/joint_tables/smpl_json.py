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
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import NotACaptureError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import from_rotvec, multiply, rotate, to_rotvec
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.json_text import numbers, parse_json
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.clocks.video_clock import is_frame_number, times_of_frames
from kinemimic.pipeline.readers.landmarks.mediapipe_frames import numbered, one_document
from kinemimic.pipeline.readers.landmarks.mediapipe_json import numbers_beside, rate_beside_frames
from kinemimic.pipeline.readers.landmarks.one_person import is_person, rows_of_one_person
from kinemimic.pipeline.readers.segments.smpl_arrays import (
    BODY,
    COUNTS,
    SmplArrays,
    path_of,
    smpl_arrays,
    turns,
    vectors,
)
from kinemimic.pipeline.readers.segments.smpl_clip import (
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
_FRAME, _PERSON = "frame", "person_id"


@dataclass(frozen=True)
class _Row:
    """Parameters of a person in a frame, or in all frames of an object, and what is beside them."""

    arrays: dict[str, Array]
    beside: dict[str, Any]


def recognises(source: Source) -> bool:
    """True for JSON with the names of these arrays, the first of which has a number of values that fits."""
    if source.head[0].lstrip()[:1] not in ("{", "["):
        return False
    names = _names({key.decode() for key in _KEY.findall(source.content[:_SEARCHED])})
    if names is None:
        return False
    return _shaped(_first(source, names.rotations[-1]), _counts(names)[names.rotations[-1]]) is not None


def read(source: Source) -> Clip:
    """The motion, as `amass.read`; of several people, the one who is in most frames."""
    document = parse_json(one_document(source))
    names, rows = _rows(document, source)
    arrays = {name: _stacked([row.arrays[name] for row in rows], name, source) for name in _counts(names)}
    frames = len(arrays[names.rotations[-1]])
    path = path_of(arrays, names, frames, source)
    if names == _EASYMOCAP:
        turned, path = _from_easymocap(arrays, path, source)
    else:
        turned = turns(arrays, names, source)
    beside = numbers_beside([row.beside for row in rows], source) if len(rows) > 1 else rows[0].beside
    own, people = rows_of_one_person(beside, path[:, None])
    turned, path = turned[own], path[own]
    beside = {name: given[own] for name, given in beside.items()}
    if _FRAME in beside and np.array_equal(beside[_FRAME], np.arange(len(own))):
        del beside[_FRAME]  # says nothing
    times = times_of_frames(
        len(own), beside, source, lambda row: f"frame {own[row]}", rate=rate_beside_frames(document, source)
    )
    step = float(np.median(np.diff(times.seconds))) if len(times.seconds) > 1 else 0.0
    motion = SmplMotion(
        turned=turned[times.kept],
        path=path[times.kept],
        times=times.seconds - times.seconds[0],
        rate=1.0 / step if step else 1.0,
        gender="neutral",
        names=(names.rotations[-1], names.path),
    )
    defects = [*times.defects, *people]
    return clip_of_motion(motion, source, FORMAT, notes=[times.note], defects=defects, arrays=sorted(arrays))


def _names(keys: set[str]) -> SmplArrays | None:
    return _EASYMOCAP if keys.issuperset((*_EASYMOCAP.rotations, _EASYMOCAP.path)) else smpl_arrays(keys)


def _counts(names: SmplArrays) -> dict[str, tuple[int, ...]]:
    """Array -> the numbers of vectors that a frame may have in it."""
    *root, joints = names.rotations
    of_joints: tuple[int, ...] = tuple(count - 1 for count in COUNTS) if root else COUNTS
    if names == _EASYMOCAP:
        of_joints = (*_ROOTLESS, *_ROOTED)
    return {**dict.fromkeys(root, (1,)), joints: of_joints, names.path: (1,)}


def _first(source: Source, name: str) -> Any:
    """The first value of a key, None if it is no JSON."""
    key = re.search(rf'"{name}"\s*:\s*', source.text)
    try:
        return json.JSONDecoder().raw_decode(source.text, key.end())[0] if key else None
    except (ValueError, RecursionError):
        return None


def _shaped(value: Any, counts: tuple[int, ...], *, path: bool = False) -> Array | None:
    """Vectors (T, J, 3) or matrices (T, J, 3, 3), J one of `counts`, T = 1 for those of one frame; None for
    anything else, and for matrices in a path."""
    array = numbers(value)
    if array is None or not array.size or array.ndim > 4:
        return None
    matrices = not path and array.shape[-2:] == (3, 3) and (array.ndim > 2 or counts == (1,))
    last = (3, 3) if matrices else (3,)
    joints, rest = divmod(array.size, int(np.prod(last)))
    if rest:
        return None
    if joints in counts:
        return array.reshape(1, joints, *last)
    each, rest = divmod(joints, len(array))
    return None if rest or each not in counts else array.reshape(len(array), each, *last)


def _rows(document: Any, source: Source) -> tuple[SmplArrays, list[_Row]]:
    """The names of the arrays, and the parameters of everybody in all frames, or of one object."""
    found = list(_people(document))
    names = next((names for *_, names in found), None)
    if names is None or len(found) > _MOST_FRAMES:
        raise NotACaptureError(
            source.path,
            expected=f"at most {_MOST_FRAMES} frames with parameters of an SMPL body",
            found=f"{len(found)}",
        )
    rows = []
    for beside, parameters, _ in found:
        arrays: dict[str, Array] = {}
        for name, counts in _counts(names).items():
            array = _shaped(parameters.get(name), counts, path=name == names.path)
            if array is None:
                raise source.error(
                    expected=_expected(names, name),
                    found=f"{parameters.get(name)!r}"[:40],
                    where=f"frame {beside[_FRAME]}",
                )
            arrays[name] = array
        rows.append(_Row(arrays, beside))
    frames = [len(row.arrays[names.rotations[-1]]) for row in rows]
    if len(rows) > 1 and max(frames) > 1:
        raise source.error(
            expected="one object with the arrays of all frames, or an object for each frame",
            found=f"{len(rows)} objects of up to {max(frames)} frames",
            advice="save each motion as a file",
        )
    return names, rows if len(rows) > 1 else [_Row(rows[0].arrays, _columns(found[0][1], frames[0]))]


def _columns(parameters: dict[str, Any], frames: int) -> dict[str, Array]:
    """The numbers of each frame in an object of the arrays of all."""
    found = {name: numbers(value) for name, value in parameters.items() if isinstance(value, list)}
    return {name: array for name, array in found.items() if array is not None and array.shape == (frames,)}


def _expected(names: SmplArrays, name: str) -> str:
    if name == names.path:
        return f"x, y and z in {name}"
    if name != names.rotations[-1]:
        return f"an axis-angle vector in {name}"
    return f"axis-angle vectors of {', '.join(map(str, _counts(names)[name]))} joints in {name}"


def _people(document: Any) -> Iterator[tuple[dict[str, Any], dict[str, Any], SmplArrays]]:
    """For everybody in a frame: numbers and words beside the parameters, the parameters, and their names."""
    for place, frame in _frames(document):
        for order, person in enumerate(_in_frame(frame)):
            if (names := _names(set(person))) is not None:
                around = {**_scalars(frame), **_scalars(person)}
                number = next((one for key, one in around.items() if is_frame_number(key)), place)
                key = next((key for key in around if key.lower() == "id" or is_person(key)), None)
                yield {**around, _FRAME: number, _PERSON: around[key] if key else order}, person, names


def _frames(document: Any) -> list[tuple[int, Any]]:
    """The frames with their numbers, or places in the list."""
    content = document
    if isinstance(content, dict) and _names(set(content)) is None:
        content = numbered(content) or max(
            (one for one in content.values() if isinstance(one, list)), key=len, default=[]
        )
        if content and isinstance(content[0], tuple):
            return content
    return list(enumerate(content if isinstance(content, list) else [content]))


def _in_frame(frame: Any) -> list[dict[str, Any]]:
    """The people of a frame: itself, its list, or the list in it."""
    if isinstance(frame, dict):
        if _names(set(frame)) is not None:
            return [frame]
        frame = next((one for one in frame.values() if isinstance(one, list)), [])
    return [one for one in frame if isinstance(one, dict)] if isinstance(frame, list) else []


def _scalars(value: Any) -> dict[str, Any]:
    items = value.items() if isinstance(value, dict) else ()
    return {
        key: one for key, one in items if isinstance(one, int | float | str) and not isinstance(one, bool)
    }


def _stacked(arrays: list[Array], name: str, source: Source) -> Array:
    shapes = {array.shape[1:] for array in arrays}
    if len(shapes) > 1:
        found = " and ".join(map(str, sorted(shapes)))
        raise source.error(expected=f"{name} of one shape in all frames", found=found)
    return np.concatenate(arrays)


def _from_easymocap(arrays: dict[str, Array], path: Array, source: Source) -> tuple[Array, Array]:
    """Turns (T, 22, 3) and the pelvis' path (T, 3): that of a body that turns about the model's origin."""
    of_body, of_joints = (
        vectors(arrays[name], name, _counts(_EASYMOCAP)[name], source) for name in ("Rh", "poses")
    )
    if len(of_body) != len(of_joints):
        raise source.error(
            expected=f"as many frames in Rh as in poses, {len(of_joints)}", found=f"{len(of_body)}"
        )
    require_turns(of_body, "Rh", source)
    require_turns(of_joints, "poses", source)
    require_path(path, _EASYMOCAP.path, source)
    turn, count = from_rotvec(of_body[:, 0]), of_joints.shape[1]
    rootless = count in _ROOTLESS
    turned = np.zeros((len(of_joints), BODY, 3))
    turned[:, 1:] = of_joints[:, : BODY - 1] if rootless else of_joints[:, 1:BODY]
    turned[:, 0] = to_rotvec(turn if rootless else multiply(turn, from_rotvec(of_joints[:, 0])))
    pelvis = np.array(_PELVIS_X if count in _JOINTS_X else _PELVIS)
    return turned, path + rotate(turn, np.broadcast_to(pelvis, path.shape))
