"""Parse the text of a BVH file: its hierarchy of joints and its table of motion, not interpreted further."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.readers.base.numbers import parse_table, to_number
from kinemimic.pipeline.readers.base.source import Source

# Limits against files that are not of a person: a body with all fingers is about 12 deep and has 70 joints.
MAX_DEPTH = 128
MAX_JOINTS = 1024
MAX_JOINT_FRAMES = 50_000_000
# In any unit and in degrees. Larger numbers are damage, and would overflow later.
MAX_NUMBER = 1e9
CHANNELS: tuple[str, ...] = tuple(
    f"{axis}{kind}" for kind in ("position", "rotation", "scale") for axis in "XYZ"
)
# The lines below MOTION, some without their colon or space.
_KEYS: dict[str, re.Pattern[str]] = {
    "Frames": re.compile(r"\s*frames\s*[:\s](.*)", re.IGNORECASE),
    "Frame Time": re.compile(r"\s*frame\s*time\s*[:\s](.*)", re.IGNORECASE),
}
# Seconds.
_FRAME_TIMES = (1e-4, 1.0)
_CHANNEL = {name.lower(): name for name in CHANNELS}


@dataclass
class Joint:
    """A joint as in the file. end: an End Site, named `<parent>_end`; parent: index, -1 for the root."""

    name: str
    parent: int
    end: bool = False
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    channels: tuple[str, ...] = ()


@dataclass
class BvhText:
    """joints: parents before children; frame_time: seconds, 0 if the file has none; motion: (T, channels) in
    the file's units and degrees; numbers: (T,) of its frames in the file, from 0, where those without a
    number in some channel are left out; declared: the number of frames that the file declares; commas:
    whether its numbers have decimal commas."""

    joints: list[Joint] = field(default_factory=list)
    frame_time: float = 0.0
    motion: Array = field(default_factory=lambda: np.zeros((0, 0)))
    numbers: NDArray[np.intp] = field(default_factory=lambda: np.zeros(0, dtype=np.intp))
    declared: int = 0
    commas: bool = False


@dataclass(frozen=True)
class _Token:
    text: str
    line: int


class _Tokens:
    """The words of the hierarchy with their lines; a brace is a separate word."""

    def __init__(self, lines: Sequence[str], source: Source) -> None:
        self.source = source
        self._words = self._split(lines)
        self._last = len(lines)

    @staticmethod
    def _split(lines: Sequence[str]) -> Iterator[_Token]:
        for number, line in enumerate(lines, 1):
            for word in line.replace("{", " { ").replace("}", " } ").split():
                yield _Token(word, number)

    def next(self, expected: str) -> _Token:
        token = next(self._words, None)
        if token is None:
            raise self.source.error(
                expected=expected,
                found="the end of the file",
                line=self._last,
                advice="the file is cut off there",
            )
        return token

    def require(self, word: str) -> _Token:
        token = self.next(word)
        if token.text.lower() != word.lower():
            raise self.error(token, word)
        return token

    def number(self, expected: str) -> float:
        token = self.next(expected)
        value = to_number(token.text)
        if value is None or not abs(value) < MAX_NUMBER:
            raise self.error(token, expected)
        return value

    def error(self, token: _Token, expected: str) -> CaptureError:
        return self.source.error(expected=expected, found=repr(token.text[:40]), line=token.line)


def parse(source: Source) -> BvhText:
    """Hierarchy and motion; CaptureError names the line of the first mistake.

    All frames in the file are read, regardless of the number that it declares, if the last line is complete.
    """
    if _has_decimal_commas(source):
        bvh = parse(source.with_text("\n".join(source.lines).replace(",", ".")))
        bvh.commas = True
        return bvh
    if separator := _separator(source):
        source = source.with_text("\n".join(source.lines).replace(separator, " "))
    lines = source.lines
    marker = next((i for i, line in enumerate(lines) if line.strip().lower() == "motion"), None)
    bvh = BvhText(joints=_hierarchy(_Tokens(lines[:marker], source)))
    if marker is None:
        raise source.error(
            expected="MOTION", found="the end of the file", line=len(lines),
            advice="the file is cut off there",
        )  # fmt: skip
    frames, bvh.frame_time, start = _declared(source, marker + 1)
    width = sum(len(joint.channels) for joint in bvh.joints)
    if width == 0:
        raise source.error(expected="a joint with CHANNELS", found="none")
    frame_count = max(frames, len(lines) - start)
    if frame_count * len(bvh.joints) > MAX_JOINT_FRAMES:
        raise source.error(
            expected=f"at most {MAX_JOINT_FRAMES} joints times frames",
            found=f"{len(bvh.joints)} joints in {frame_count} frames",
            line=marker + 2,
        )
    table = parse_table(_unwrapped(source, start, width), start=start, width=width)
    bvh.motion, bvh.declared = table.values, frames
    known = np.isfinite(bvh.motion).all(axis=1)
    wrong: Mask = np.asarray(~(np.abs(bvh.motion) < MAX_NUMBER))  # NaN too
    if known.any():
        wrong[~known] = False
    if wrong.any():
        frame, channel = (int(k) for k in np.argwhere(wrong)[0])
        raise source.error(
            expected="finite numbers", found=f"{bvh.motion[frame, channel]} in channel {channel + 1}",
            where=f"line {table.line(frame)}, frame {frame}",
        )  # fmt: skip
    bvh.numbers = np.flatnonzero(known)
    if not known.all():
        bvh.motion = bvh.motion[known]
    return bvh


def _unwrapped(source: Source, start: int, width: int) -> Source:
    """The source with each frame whole in its first line, if the numbers of a frame, `width`, are wrapped
    over several lines; itself if they are not.

    Raises CaptureError for a line that is longer or shorter than in the first frame, if it is not the last.
    """
    lines = list(source.lines)
    head = islice((line for line in lines[start:] if line.strip()), width)
    counts = np.cumsum([len(line.split()) for line in head])
    if width not in counts[1:]:
        return source
    rows = int(np.searchsorted(counts, width)) + 1  # of a frame
    filled = [number for number in range(start, len(lines)) if lines[number].strip()]
    for place, number in enumerate(filled):
        words = lines[number].split()
        first = filled[place % rows]
        wanted = len(source.lines[first].split())
        if len(words) != wanted and number != filled[-1]:
            raise source.error(
                expected=f"{wanted} numbers, as in line {first + 1}", found=f"{len(words)}", line=number + 1
            )
        if place % rows:
            lines[number] = ""
            lines[filled[place - place % rows]] += " " + " ".join(words)
    return source.with_text("\n".join(lines))


def _last_line(source: Source) -> str:
    return next((line for line in reversed(source.lines) if line.strip()), "")


def _has_decimal_commas(source: Source) -> bool:
    """True if the last line has commas but no point, as exported under a German locale, for example."""
    last = _last_line(source)
    return "," in last and "." not in last and all(word.count(",") < 2 for word in last.split())


def _separator(source: Source) -> str | None:
    """A comma or semicolon between the numbers of the last line, or None."""
    last = _last_line(source)
    return next((mark for mark in ",;" if mark in last and last.strip().strip(mark).count(mark) > 1), None)


def _declared(source: Source, start: int) -> tuple[int, float, int]:
    """Number of frames and seconds per frame (0 if there is none), from the two lines below MOTION; and the
    line at which the motion starts."""
    filled = [(k, line) for k, line in enumerate(source.lines[start : start + 64], start) if line.strip()][:2]
    values: list[str] = []
    for position, (key, spelt) in enumerate(_KEYS.items()):
        number, line = filled[position] if position < len(filled) else (len(source.lines) - 1, "")
        found = spelt.fullmatch(line)
        if found is None:
            shown = repr(line.strip()[:40]) if line else "the end of the file"
            raise source.error(expected=f"{key}: and a number", found=shown, line=number + 1)
        values.append(found[1].strip())
    if not (values[0].isascii() and values[0].isdigit() and len(values[0]) < 12 and int(values[0]) > 0):
        raise source.error(
            expected="a number of frames above 0", found=repr(values[0][:40]), line=filled[0][0] + 1
        )
    seconds = to_number(values[1] or "0")
    if seconds is None or not (seconds == 0.0 or _FRAME_TIMES[0] <= seconds <= _FRAME_TIMES[1]):
        raise source.error(
            expected=f"a frame time of {_FRAME_TIMES[0]:g} to {_FRAME_TIMES[1]:g} s",
            found=repr(values[1][:40]),
            line=filled[1][0] + 1,
            advice="write the seconds from one frame to the next there, or 0 and give --rate",
        )
    return int(values[0]), seconds, filled[1][0] + 1


def _hierarchy(tokens: _Tokens) -> list[Joint]:
    """Joints in the file's order. Iterative, so that nesting needs no stack."""
    tokens.require("HIERARCHY")
    tokens.require("ROOT")
    joints: list[Joint] = []
    names: set[str] = set()
    open_joints: list[int] = []

    def begin(end: bool) -> None:
        # A name may contain spaces; the brace ends it.
        words: list[str] = []
        while (token := tokens.next("a joint's name and {")).text != "{":
            words.append(token.text)
        parent = open_joints[-1] if open_joints else -1
        name = f"{joints[parent].name}_end" if end else " ".join(words)
        if not name:
            raise tokens.error(token, "a joint's name")
        if len(open_joints) >= MAX_DEPTH or len(joints) >= MAX_JOINTS:
            raise tokens.source.error(
                expected=f"at most {MAX_JOINTS} joints, nested at most {MAX_DEPTH} deep",
                found="more",
                line=token.line,
            )
        unique, count = name, 1
        while unique in names:
            count += 1
            unique = f"{name}_{count}"
        names.add(unique)
        open_joints.append(len(joints))
        joints.append(Joint(unique, parent, end))

    begin(end=False)
    while open_joints:
        joint = joints[open_joints[-1]]
        token = tokens.next("OFFSET, CHANNELS, JOINT, End Site or }")
        match token.text.lower():
            case "offset":
                x, y, z = (tokens.number("three numbers after OFFSET") for _ in range(3))
                joint.offset = (x, y, z)
            case "channels" if not joint.end:
                joint.channels = _channels(tokens)
            case "joint" if not joint.end:
                begin(end=False)
            case "end" if not joint.end:
                begin(end=True)
            case "}":
                open_joints.pop()
            case _:
                raise tokens.source.error(
                    expected="OFFSET, CHANNELS, JOINT, End Site or }",
                    found=repr(token.text[:40]),
                    line=token.line,
                    advice="BVH has no such keyword: delete its lines, or export again",
                )
    if (extra := next(tokens._words, None)) is not None:
        if extra.text.lower() == "root":
            raise tokens.source.error(
                expected="one ROOT",
                found="a second one",
                line=extra.line,
                advice="export each person or object to a separate file",
            )
        raise tokens.error(extra, "MOTION after the one ROOT")
    return joints


def _channels(tokens: _Tokens) -> tuple[str, ...]:
    count = tokens.next("the number of channels")
    if count.text not in {str(n) for n in range(len(CHANNELS) + 1)}:
        raise tokens.error(count, f"0 to {len(CHANNELS)} channels")
    names: list[str] = []
    for _ in range(int(count.text)):
        token = tokens.next("a channel")
        name = _CHANNEL.get(token.text.lower())
        if name is None or name in names:
            raise tokens.error(token, f"channels among {', '.join(CHANNELS)}, each once")
        names.append(name)
    return tuple(names)
