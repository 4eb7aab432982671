"""NTU RGB+D's `.skeleton` files: the 25 joints of a Kinect v2, of up to six people.

A. Shahroudy, J. Liu, T.-T. Ng, G. Wang, "NTU RGB+D: A Large Scale Dataset for 3D Human Activity Analysis"
(CVPR 2016), and NTU RGB+D 120, which has the same layout. The number of frames; then for each frame the
number of bodies, and for each of these a line of 10 numbers (the body's ID first), the number of joints, and
a line of 12 numbers per joint: x, y, z (metres, camera space), its pixels in the depth and the color image,
its absolute orientation (w, x, y, z) and its state, in the SDK's order. The files have no times; the sensor
has 30 frames per second. Chairs and other things are sometimes tracked as bodies.
"""

from __future__ import annotations

from collections import Counter
from itertools import chain

import numpy as np

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import Y_UP_TO_Z_UP
from kinemimic.pipeline.kinematics.skeleton import TRACKED
from kinemimic.pipeline.plural import plural
from kinemimic.pipeline.readers.base.absolute_orientations import child_to_parent
from kinemimic.pipeline.readers.base.clip_building import clip_of_points, reading
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import refuse_remote
from kinemimic.pipeline.readers.base.numbers import numbers_of
from kinemimic.pipeline.readers.base.people import found_again, other_people
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.kinect.kinect_v2 import FROM_SDK, SDK_JOINTS, kinect_v2_skeleton
from kinemimic.pipeline.readers.kinect.kinect_values import check_quaternions, check_states

FORMAT = Format(
    name="NTU RGB+D .skeleton",
    sensor="Kinect v2",
    holds="positions, states and orientations of 25 joints, up to six people",
    recognised_by="a number of frames, a number of bodies, then 10 numbers, 25, and 25 lines of 12 numbers",
)
# In Hz. The file has no times; this is the sensor's rate.
RATE = 30.0
_BODY_WIDTH, _JOINT_WIDTH = 10, 12
_MAX_BODIES = 6  # of the sensor
_MAX_FRAMES = 216_000  # two hours


def recognises(source: Source) -> bool:
    """True if single numbers come first, and the first other line begins a body of 25 joints."""
    words = [line.split() for line in source.head]
    first = next((number for number, line in enumerate(words) if len(line) != 1), len(words))
    counts = [line[0] for line in words[:first]]
    if len(counts) < 2 or not all(count.isdecimal() for count in counts):
        return False
    if first == len(words):  # nobody yet, or nobody at all
        return not any(int(count) for count in counts[1:])
    following = words[first + 1 : first + 3]
    return (
        len(words[first]) == _BODY_WIDTH
        and len(following) == 2
        and following[0] == [str(len(SDK_JOINTS))]
        and len(following[1]) == _JOINT_WIDTH
    )


def read(source: Source) -> Clip:
    """The clip of the body seen in most frames, 25 joints with rotations, one frame per frame of the file.

    Of bodies seen equally often, the one with the most tracked joints. Where that body is not seen, every
    joint is missing. Other bodies are dropped and counted.
    """
    lines = _Lines(source)
    frames = [_bodies(lines) for _ in range(lines.count("frames", _MAX_FRAMES))]
    lines.end()
    if not any(frames):
        raise source.error(expected="a person", found=f"{plural(len(frames), 'frame')} without one")
    begins = [line for bodies in frames for line in bodies.values()]
    values = lines.joints(begins)

    def where(row: int) -> str:
        return f"body of line {begins[row] - 1}"

    points, orientations, states = values[..., :3], values[..., [8, 9, 10, 7]], values[..., 11]
    check_states(states, SDK_JOINTS, where, source)
    refuse_remote(points, SDK_JOINTS, source, where)
    check_quaternions(orientations, SDK_JOINTS, where, source)
    numbers = [number for number, found in enumerate(frames) for _ in found]
    found = found_again(np.array(numbers, dtype=np.float64), np.array([*chain(*frames)]), points)
    bodies = found.people.tolist()
    people: list[set[int]] = [set() for _ in frames]
    for number, body in zip(numbers, bodies, strict=True):
        people[number].add(body)
    seen = Counter(found.people[found.kept].tolist())
    tracked = Counter[int]()
    for body, count in zip(bodies, (states == TRACKED).sum(axis=1).tolist(), strict=True):
        tracked[body] += count
    main_person = max(seen, key=lambda body: (seen[body], tracked[body]))
    rows = np.flatnonzero(found.kept & (found.people == main_person))
    at = np.array(numbers)[rows]
    shape = (len(frames), len(SDK_JOINTS))
    kept = np.full((*shape, _JOINT_WIDTH), np.nan)
    kept[at] = values[rows]
    known = np.zeros(shape, dtype=np.uint8)
    known[at] = states[rows]
    skeleton = kinect_v2_skeleton()
    return clip_of_points(
        skeleton,
        np.arange(len(frames)) / RATE,
        kept[:, FROM_SDK, :3],
        known[:, FROM_SDK],
        format=FORMAT,
        reading=reading(
            units="m",
            units_rule="the format's",
            defects=[*found.defects(), *other_people(people, main_person)],
            notes=[f"no time in the file: {RATE:g} Hz, the sensor's rate"],
        ),
        rotations=child_to_parent(kept[:, FROM_SDK][..., [8, 9, 10, 7]], skeleton, Y_UP_TO_Z_UP),
    )


def _bodies(lines: _Lines) -> dict[int, int]:
    """The bodies of the next frame: ID -> index of the first line of its joints."""
    found: dict[int, int] = {}
    for _ in range(lines.count("bodies", _MAX_BODIES)):
        body = lines.body()
        lines.count("joints", len(SDK_JOINTS), least=len(SDK_JOINTS))
        found[body] = lines.skip(len(SDK_JOINTS))
    return found


class _Lines:
    """The lines of a file, read one after another."""

    def __init__(self, source: Source) -> None:
        self._source = source
        self._lines = source.lines
        self._next = 0

    def _line(self, expected: str) -> list[str]:
        while self._next < len(self._lines) and not self._lines[self._next].strip():
            self._next += 1
        if self._next >= len(self._lines):
            raise self._source.error(
                expected=expected, found="the end of the file", advice="the file is cut off there"
            )
        self._next += 1
        return self._lines[self._next - 1].split()

    def count(self, of: str, most: int, least: int = 0) -> int:
        """The number that stands alone in the next line."""
        expected = f"a number of {of}, " + (f"{most}" if least == most else f"{least} to {most}")
        line = self._line(expected)
        if len(line) != 1 or not line[0].isdecimal() or not least <= int(line[0]) <= most:
            raise self._source.error(expected=expected, found=_shown(line), line=self._next)
        return int(line[0])

    def body(self) -> int:
        """The ID of the body that the next line describes."""
        expected = f"{_BODY_WIDTH} numbers of a body, its ID first"
        line = self._line(expected)
        if len(line) != _BODY_WIDTH or not line[0].isdecimal():
            raise self._source.error(expected=expected, found=_shown(line), line=self._next)
        return int(line[0])

    def skip(self, count: int) -> int:
        """Skip this many lines; returns the index of the first."""
        first = self._next
        self._next += count
        return first

    def end(self) -> None:
        """Raise CaptureError unless nothing but blank lines follows."""
        for number in range(self._next, len(self._lines)):
            if self._lines[number].strip():
                raise self._source.error(
                    expected="the end of the file after its frames",
                    found=_shown(self._lines[number].split()),
                    line=number + 1,
                    advice="correct the number of frames in line 1",
                )

    def joints(self, begins: list[int]) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
        """The numbers (B, 25, 12) of the bodies whose joints begin at these lines."""
        numbers = [begin + k for begin in begins for k in range(len(SDK_JOINTS))]
        values = np.empty((len(numbers), _JOINT_WIDTH))
        for row, number in enumerate(numbers):
            line = self._lines[number] if number < len(self._lines) else ""
            found = numbers_of(line, None) if line.strip() else None
            if found is None or len(found) != _JOINT_WIDTH:
                raise self._source.error(
                    expected=f"{_JOINT_WIDTH} numbers of {SDK_JOINTS[row % len(SDK_JOINTS)]}",
                    found=_shown(line.split()),
                    where=f"line {number + 1}",
                )
            values[row] = found
        return values.reshape(len(begins), len(SDK_JOINTS), _JOINT_WIDTH)


def _shown(words: list[str]) -> str:
    """Words of a line, for a message."""
    return f"{len(words)} words" if len(words) > 1 else repr(words[0][:40]) if words else "an empty line"
