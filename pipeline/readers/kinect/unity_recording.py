"""Body frames that the Unity assets for Kinect v2 and Azure Kinect record (KinectRecorderPlayer).

A line is a frame: the game's seconds, "|", and cells that commas or semicolons separate. They are "kb" (the
asset for Kinect v2) or "k4b" (for Azure Kinect), the sensor's clock, the numbers of bodies and joints, in
"k4b" three signs that turn the sensor's axes into a Kinect v2's, and then the bodies. A body that is not
there is a 0; one that is there, a 1, its identity and its joints: a state from 0 to 3 and, unless that is 0,
the place in metres, in "k4b" also three angles, of avatars, which are not read. The asset for Kinect v2 has
the SDK's 25 joints, or with a Kinect v1 its 20; that for Azure Kinect an order of its own, face and fingers
last.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import MISSING, TRACKED, Skeleton, node_skeleton
from kinemimic.pipeline.readers.base.clip_building import clip_of_points, reading
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import refuse_remote
from kinemimic.pipeline.readers.base.numbers import to_number
from kinemimic.pipeline.readers.base.people import other_people, renumbered
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.kinect.azure_joints import AZURE_JOINTS, azure_skeleton
from kinemimic.pipeline.readers.kinect.kinect_v2 import FROM_SDK, kinect_v2_skeleton
from kinemimic.pipeline.readers.kinect.kinect_values import check_states, sensor_clock

FORMAT = Format(
    name="Unity Kinect recording",
    sensor="Kinect v1, v2 or Azure Kinect",
    holds="times, positions and states of 20, 25 or 32 joints, any number of people",
    recognised_by='lines that begin with a time, "|" and "kb" or "k4b"',
)
_LINE = re.compile(r"\ufeff?\s*(-?\d+(?:[.,]\d+)?)\|(kb|k4b)([,;\t])")
# Joints of the asset for Azure Kinect.
_ARM, _LEG = ("CLAVICLE", "SHOULDER", "ELBOW", "WRIST", "HAND"), ("HIP", "KNEE", "ANKLE", "FOOT")
UNITY_AZURE_JOINTS: tuple[str, ...] = (
    *("PELVIS", "SPINE_NAVEL", "SPINE_CHEST", "NECK", "HEAD"),
    *(f"{joint}_{side}" for limb in (_ARM, _LEG) for side in ("LEFT", "RIGHT") for joint in limb),
    *("NOSE", "EYE_LEFT", "EAR_LEFT", "EYE_RIGHT", "EAR_RIGHT"),
    *(f"{joint}_{side}" for side in ("LEFT", "RIGHT") for joint in ("HANDTIP", "THUMB")),
)
# A state that the asset keeps for later.
_SURE = 3.0
# Seconds of a tick of the sensor's clock, of .NET and of other SDKs; how far the game's time may be off.
_TICKS, _TOLERANCE = (1e-7, 1e-6, 1e-3), 0.05


@dataclass(frozen=True)
class _Kind:
    """The layout of a file's lines. order: where the skeleton's joints are among the file's."""

    skeleton: Skeleton
    order: tuple[int, ...]
    signs: int  # cells between the number of joints and the bodies
    numbers: int  # of a joint with a state


def _kinds() -> dict[tuple[str, int], _Kind]:
    """The layouts, by the word at the beginning and the number of joints."""
    azure = tuple(UNITY_AZURE_JOINTS.index(joint) for joint in AZURE_JOINTS)
    return {
        # The joints of a Kinect v1 have the same order as the first 20 of a v2, and as our nodes.
        ("kb", 20): _Kind(node_skeleton(), tuple(range(20)), 0, 3),
        ("kb", 25): _Kind(kinect_v2_skeleton(), FROM_SDK, 0, 3),
        ("k4b", 32): _Kind(azure_skeleton(), azure, 3, 6),
    }


def recognises(source: Source) -> bool:
    """True if the first line begins with a time and the word of one of the assets."""
    return _LINE.match(source.head[0]) is not None


def read(source: Source) -> Clip:
    """The clip of the person seen in most frames; where only others are, every joint is missing.

    Raises CaptureError for a line with too few or too many cells, or with a cell that is no number.
    """
    frames = list(_frames(source))
    kind = frames[0].kind
    times, notes = _seconds(frames)
    people, anew = renumbered(times, [frame.bodies for frame in frames], lambda body: body[:, 1:])
    count = Counter(body for bodies in people for body in bodies)
    if not count:
        raise source.error(expected="a person", found="none in any line")
    main = count.most_common(1)[0][0]
    nobody = np.full((len(kind.order), 4), float(MISSING))
    values = np.stack([bodies.get(main, nobody) for bodies in people])[:, kind.order]
    places, states = values[..., 1:], np.where(values[..., 0] == _SURE, TRACKED, values[..., 0])

    def where(frame: int) -> str:
        return f"line {frames[frame].line}"

    check_states(states, kind.skeleton.names, where, source)
    refuse_remote(places, kind.skeleton.names, source, where)
    later, defects = sensor_clock(times, where, source)
    others = [*anew, *other_people([set(bodies) for bodies in people], main)]
    return clip_of_points(
        kind.skeleton,
        times[later],
        places[later],
        states[later],
        format=FORMAT,
        reading=reading(units="m", units_rule="the format's", defects=[*defects, *others], notes=notes),
    )


@dataclass(frozen=True)
class _Frame:
    """A line. seconds: the game's; ticks: the sensor's; bodies: (J, 4), state and place, of each identity."""

    line: int
    kind: _Kind
    seconds: float
    ticks: float
    bodies: dict[int, Array]


def _frames(source: Source) -> Iterator[_Frame]:
    kinds, first = _kinds(), None
    for number, line in enumerate(source.lines, 1):
        if not line.strip():
            continue
        begin = _LINE.match(line)
        if begin is None:
            raise source.error(expected='a time, "|" and "kb" or "k4b"', found=repr(line[:30]), line=number)
        seconds, word, separator = begin.groups()
        words = line[begin.end() :].strip().rstrip(separator).split(separator)
        cells = _numbers(words, source, number)
        head = [int(value) for value in cells[:3] if np.isfinite(value)]
        kind = kinds.get((word, head[2])) if len(head) == 3 else None
        if kind is None or (first or kind) is not kind:
            raise source.error(
                expected="20 or 25 joints of kb, or 32 of k4b, as many in every line",
                found=f"{word} with {head[2] if len(head) == 3 else 'no'} joints",
                line=number,
            )
        first = kind
        bodies = _bodies(words[3:], cells[3:], head[1], kind, source, number)
        yield _Frame(number, kind, float(seconds.replace(",", ".")), cells[0], bodies)


def _numbers(cells: list[str], source: Source, line: int) -> list[float]:
    values = [to_number(cell.replace(",", ".")) for cell in cells]
    if None in values:
        raise source.error(expected="numbers", found=repr(cells[values.index(None)][:30]), line=line)
    return [value for value in values if value is not None]


def _bodies(
    words: list[str], cells: list[float], count: int, kind: _Kind, source: Source, line: int
) -> dict[int, Array]:
    """The bodies in the cells after the number of joints, in the axes of a Kinect v2.

    words: the cells as written; an identity has more digits than a float.
    """
    # Sensors have right-handed axes: two signs are turned, or none.
    signs = np.array(cells[: kind.signs] or [1.0, 1.0, 1.0])
    at, bodies = kind.signs, {}
    try:
        for _ in range(count):
            at += 1
            if cells[at - 1] == 0.0:
                continue
            body, at = int(words[at]), at + 1
            joints = np.zeros((len(kind.order), 4))
            for joint in joints:
                joint[0], at = cells[at], at + 1
                if joint[0] != MISSING:
                    joint[1:], at = np.array(cells[at : at + 3]) * signs, at + kind.numbers
            bodies[body] = joints
    except (IndexError, ValueError):  # no cell, no three numbers, no identity
        at = len(cells) + 1
    if at != len(cells):
        raise source.error(
            expected=f"the cells of {count} bodies of {len(kind.order)} joints",
            found=f"{'too few' if at > len(cells) else 'too many'}, {len(cells)}",
            line=line,
            advice="decimal commas between commas cannot be told apart" if at < len(cells) else None,
        )
    return bodies


def _seconds(frames: list[_Frame]) -> tuple[Array, list[str]]:
    """The time of each frame, and a note on whose clock it is.

    The sensor's is the finer one, but its unit is that of the SDK: it is told by the game's time.
    """
    game = np.array([frame.seconds for frame in frames])
    ticks = np.array([frame.ticks - frames[0].ticks for frame in frames])
    for tick in _TICKS:
        if abs(ticks[-1] * tick - (game[-1] - game[0])) <= _TOLERANCE * (game[-1] - game[0]):
            return ticks * tick, []
    return game, ["the sensor's clock does not agree with the game's: times are the game's"]
