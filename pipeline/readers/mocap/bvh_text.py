"""Parse the text of a BVH file: its hierarchy of joints and its table of motion, not interpreted further."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.joint_names import REQUIRED, joints_by_name
from kinemimic.pipeline.readers.base.numbers import parse_table, to_number
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.mocap.bvh_hierarchy import MAX_NUMBER, Joint, Tokens, hierarchy

MAX_JOINT_FRAMES = 50_000_000
# The lines below MOTION, some without their colon or space.
_KEYS: dict[str, re.Pattern[str]] = {
    "Frames": re.compile(r"\s*frames\s*[:\s](.*)", re.IGNORECASE),
    "Frame Time": re.compile(r"\s*frame\s*time\s*[:\s](.*)", re.IGNORECASE),
}
_MOTION = re.compile(r"\s*motion\s*:?\s*", re.IGNORECASE)
_COMMENT = re.compile(r"\s*(#|//)")
_SECONDS = re.compile(r"\s*s(ec(onds?)?)?\.?", re.IGNORECASE)
# Seconds; and frames per second, which some write in their place.
_FRAME_TIMES, _RATES = (1e-4, 1.0), (10.0, 1000.0)


@dataclass
class BvhText:
    """joints: of one person, parents before children; others: names of the roots of the file's other trees,
    of which `people` have legs; frame_time: seconds, 0 if the file has none; motion: (T, channels) in the
    file's units and degrees; numbers: (T,) of its frames in the file, from 0, where those without a number in
    some channel are left out; declared: the number of frames that the file declares, 0 if it does not; cut:
    whether its last frame is cut off, and left out; commas: whether its numbers have decimal commas."""

    joints: list[Joint] = field(default_factory=list)
    others: list[str] = field(default_factory=list)
    people: int = 0
    frame_time: float = 0.0
    motion: Array = field(default_factory=lambda: np.zeros((0, 0)))
    numbers: NDArray[np.intp] = field(default_factory=lambda: np.zeros(0, dtype=np.intp))
    declared: int = 0
    cut: bool = False
    commas: bool = False


def parse(source: Source) -> BvhText:
    """Hierarchy and motion; CaptureError names the line of the first mistake.

    All frames in the file are read, regardless of the number that it declares.
    """
    if _has_decimal_commas(source):
        bvh = parse(source.with_text("\n".join(source.lines).replace(",", ".")))
        bvh.commas = True
        return bvh
    if separator := _separator(source):
        source = source.with_text("\n".join(source.lines).replace(separator, " "))
    lines = source.lines
    marker = next((i for i, line in enumerate(lines) if _MOTION.fullmatch(line)), None)
    head = ["" if is_comment(line) else line for line in lines[:marker]]
    trees = hierarchy(Tokens(head, source))
    if marker is None:
        raise source.error(
            expected="MOTION", found="the end of the file", line=len(lines),
            advice="the file is cut off there",
        )  # fmt: skip
    frames, frame_time, start = _declared(source, marker + 1)
    widths = [sum(len(joint.channels) for joint in tree) for tree in trees]
    width = sum(widths)
    if width == 0:
        raise source.error(expected="a joint with CHANNELS", found="none")
    frame_count, joints = max(frames, len(lines) - start), sum(map(len, trees))
    if frame_count * joints > MAX_JOINT_FRAMES:
        raise source.error(
            expected=f"at most {MAX_JOINT_FRAMES} joints times frames",
            found=f"{joints} joints in {frame_count} frames",
            line=marker + 2,
        )
    whole, cut = _without_cut_frame(_unwrapped(source, start, width), start, width)
    table = parse_table(whole, start=start, width=width)
    chosen, people = _person(trees)
    bvh = BvhText(trees[chosen], [tree[0].name for tree in trees if tree is not trees[chosen]], people)
    first = sum(widths[:chosen])
    bvh.motion = table.values[:, first : first + widths[chosen]]
    bvh.frame_time, bvh.declared, bvh.cut = frame_time, frames, cut
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


def is_comment(line: str) -> bool:
    """Whether a line is a comment, which the format does not have and some tools write."""
    return _COMMENT.match(line) is not None


def _person(trees: Sequence[Sequence[Joint]]) -> tuple[int, int]:
    """Index of the tree that is read: the first one whose joints have the names of legs, else the largest;
    and how many others have such names."""
    legs = [
        index
        for index, tree in enumerate(trees)
        if set(REQUIRED) <= joints_by_name(tuple(joint.name for joint in tree)).keys()
    ]
    if legs:
        return legs[0], len(legs) - 1
    return max(range(len(trees)), key=lambda index: len(trees[index])), 0


def _without_cut_frame(source: Source, start: int, width: int) -> tuple[Source, bool]:
    """The source without its last frame if that is cut off and not the only one, and whether it is."""
    filled = [number for number in range(start, len(source.lines)) if source.lines[number].strip()]
    if len(filled) < 2 or len(source.lines[filled[-1]].split()) >= width:
        return source, False
    return source.with_text("\n".join(source.lines[: filled[-1]])), True


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
    """Number of frames (0 if there is none) and seconds per frame (0 if there is none), from the two lines
    below MOTION, in any order; and the line at which the motion starts."""
    filled = [(k, line) for k, line in enumerate(source.lines[start : start + 64], start) if line.strip()][:2]
    values: dict[str, tuple[int, str]] = {}
    for number, line in filled:
        for key, spelt in _KEYS.items():
            if key not in values and (found := spelt.fullmatch(line)):
                values[key] = number, found[1].strip()
    for position, key in enumerate(_KEYS):
        if key not in values:
            number, line = filled[position] if position < len(filled) else (len(source.lines) - 1, "")
            shown = repr(line.strip()[:40]) if line else "the end of the file"
            raise source.error(expected=f"{key}: and a number", found=shown, line=number + 1)
    count, (at, written) = values["Frames"][1], values["Frame Time"]
    frames = int(count) if count.isascii() and count.isdigit() and len(count) < 12 else 0
    seconds = to_number(_SECONDS.sub("", written) or "0")
    if seconds is None or not (seconds == 0.0 or _FRAME_TIMES[0] <= seconds <= _FRAME_TIMES[1]):
        is_rate = seconds is not None and _RATES[0] <= seconds <= _RATES[1]
        raise source.error(
            expected=f"a frame time of {_FRAME_TIMES[0]:g} to {_FRAME_TIMES[1]:g} s",
            found=repr(written[:40]),
            line=at + 1,
            advice=f"if these are frames per second, write {1.0 / seconds:.6f} there"
            if is_rate and seconds
            else "write the seconds from one frame to the next there, or 0 and give --rate",
        )
    return frames, seconds, filled[1][0] + 1
