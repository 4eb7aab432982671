"""The raw Kinect v2 dump from which Kinect2BVH makes its BVH: one block of lines per frame.

A block is a time in ms, `Pos N`, N lines `joint x y z`, `Rot N`, N lines `joint qx qy qz qw`; joint is the
index in the SDK's JointType. Only tracked joints are written, so N varies from frame to frame, and a person
at a desk has no legs. Metres, Y up. The quaternions are the sensor's own estimates and are ignored: the
positions give the bones.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.readers.base.clip_building import clip_of_points, reading
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import increasing_times, refuse_remote
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.kinect.kinect_v2 import FROM_SDK, SDK_JOINTS, kinect_v2_skeleton

FORMAT = Format(
    name="Kinect2BVH raw dump",
    sensor="Kinect v2",
    holds="positions of the tracked joints of 25",
    recognised_by="a time, then a line `Pos N`",
)
_POS, _ROT = re.compile(r"Pos (\d{1,9})\s*$"), re.compile(r"Rot (\d{1,9})\s*$")
_LEG = ("Hip", "Knee", "Ankle")
# Minimum share of frames with a whole leg.
_MIN_SHARE = 0.5


@dataclass
class _Blocks:
    """times: ms, one per block; counts: joints of each block; lines: `joint x y z` of all blocks; numbers:
    line number in the file of the first of these lines in each block."""

    times: list[float] = field(default_factory=list)
    counts: list[int] = field(default_factory=list)
    lines: list[str] = field(default_factory=list)
    numbers: list[int] = field(default_factory=list)


def recognises(source: Source) -> bool:
    """True if the second line is `Pos N`, below a number."""
    return (
        len(source.head) > 2 and _POS.match(source.head[1]) is not None and source.head[0].strip().isdecimal()
    )


def read(source: Source) -> Clip:
    """The clip of the 25 joints, missing wherever a block does not have them.

    Blocks with a repeated or earlier time are dropped and counted. Raises CaptureError for an incomplete
    block, and for a recording without legs.
    """
    blocks = _blocks(source)
    points = _points(source, blocks)
    refuse_remote(points, SDK_JOINTS, source, lambda frame: f"line {blocks.numbers[frame]}")
    _refuse_without_legs(source, points)
    times = np.array(blocks.times)
    later, defects = increasing_times(times)
    return clip_of_points(
        kinect_v2_skeleton(),
        times[later] / 1000.0,
        points[later][:, FROM_SDK],
        None,
        format=FORMAT,
        reading=reading(units="m", units_rule="the format's", defects=defects),
    )


def _blocks(source: Source) -> _Blocks:
    lines = source.lines
    end = len(lines)
    while end and not lines[end - 1].strip():
        end -= 1
    found = _Blocks()
    at = source.blank_lines
    while at < end:
        found.times.append(_time(source, lines[at], at + 1))
        count = _count(source, at + 1, end, _POS, "Pos N")
        found.counts.append(count)
        found.numbers.append(at + 3)
        found.lines += lines[at + 2 : at + 2 + count]
        rotations = _count(source, at + 2 + count, end, _ROT, "Rot N")
        if rotations != count:
            raise source.error(expected=f"Rot {count}", found=f"{rotations}", line=at + 3 + count)
        at += 3 + 2 * count
    if at > end:
        raise source.error(
            expected="complete blocks",
            found=f"{at - end} lines missing from the last",
            line=end,
            advice="the file is cut off there",
        )
    return found


def _time(source: Source, line: str, number: int) -> float:
    text = line.strip()
    if not (text.isascii() and text.isdecimal() and len(text) < 16):
        raise source.error(expected="a time in ms", found=repr(text[:40]), line=number)
    return float(text)


def _count(source: Source, at: int, end: int, head: re.Pattern[str], expected: str) -> int:
    """N in the line at index `at`, checked before it is used."""
    match = head.match(source.lines[at]) if at < end else None
    if match is None:
        raise source.error(
            expected=expected,
            found=repr(source.lines[at].strip()[:40]) if at < end else "the end",
            line=min(at, end - 1) + 1,
            advice=None if at < end else "the file is cut off there",
        )
    count = int(match.group(1))
    if not 1 <= count <= len(SDK_JOINTS):
        raise source.error(expected=f"1 to {len(SDK_JOINTS)} joints", found=f"{count}", line=at + 1)
    return count


def _points(source: Source, blocks: _Blocks) -> Array:
    """Positions (T, 25, 3) in the SDK's order; NaN where a block has none."""
    try:
        rows = np.loadtxt(blocks.lines, dtype=np.float64, comments=None, ndmin=2)
    except ValueError:
        rows = np.empty((0, 0))
    if rows.shape != (len(blocks.lines), 4):
        raise _bad_line(source, blocks)
    frame = np.repeat(np.arange(len(blocks.counts)), blocks.counts)
    joint = rows[:, 0]
    wrong = ~((joint >= 0) & (joint < len(SDK_JOINTS)) & (joint == np.rint(joint)))
    if wrong.any():
        bad = int(np.argmax(wrong))
        raise source.error(
            expected=f"the index of a joint, 0 to {len(SDK_JOINTS) - 1}",
            found=f"{joint[bad]:g}",
            where=f"the block of line {blocks.numbers[int(frame[bad])]}",
        )
    points = np.full((len(blocks.counts), len(SDK_JOINTS), 3), np.nan)
    points[frame, joint.astype(np.intp)] = rows[:, 1:]
    return points


def _bad_line(source: Source, blocks: _Blocks) -> Exception:
    """The error for the first position line that is not four numbers."""
    frame = np.repeat(np.arange(len(blocks.counts)), blocks.counts)
    for line, block in zip(blocks.lines, frame, strict=True):
        try:
            good = len(np.loadtxt([line], comments=None, ndmin=1)) == 4
        except ValueError:
            good = False
        if not good:
            return source.error(
                expected="`joint x y z`",
                found=repr(line.strip()[:40]),
                where=f"the block of line {blocks.numbers[int(block)]}",
            )
    return source.error(expected="lines `joint x y z`", found="something else")


def _refuse_without_legs(source: Source, points: Array) -> None:
    """Raise CaptureError unless at least one whole leg is seen in half of the frames."""
    unseen = np.isnan(points[..., 0])
    broken = [
        np.logical_or.reduce([unseen[:, SDK_JOINTS.index(f"{joint}{side}")] for joint in _LEG])
        for side in ("Left", "Right")
    ]
    frames_with_leg = len(points) - int(np.count_nonzero(broken[0] & broken[1]))
    if frames_with_leg >= _MIN_SHARE * len(points):
        return
    share = 1.0 - unseen.mean(axis=0)
    usual_joints = [joint for joint, seen in zip(SDK_JOINTS, share, strict=True) if seen >= _MIN_SHARE]
    raise source.error(
        expected="hips, knees and ankles",
        found=f"a whole leg in {frames_with_leg} of {len(points)} frames, usually the "
        f"{len(usual_joints)} joints {', '.join(usual_joints)}",
        advice="gait cannot be reconstructed from it",
    )
