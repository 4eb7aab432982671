"""The skeletons of MSR Daily Activity 3D: the 20 joints of a Kinect v1, of up to six people.

J. Wang, Z. Liu, Y. Wu, J. Yuan, "Mining Actionlet Ensemble for Action Recognition with Depth Cameras" (CVPR
2012). The first line has the number of frames and of joints. Then each frame has a line with its number of
rows, 40 for each person, and these rows, two per joint: x, y, z in metres and a confidence; and the place in
the picture (shares of its width and height, depth) with the same confidence. The joints are in the SDK's
order, not in that of MSR-Action3D. The confidence says nothing, as the set's authors state. The files have no
times; the sensor has 30 frames per second.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODES, node_skeleton
from kinemimic.pipeline.kinematics.spans import frame_runs
from kinemimic.pipeline.plural import plural
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.readers.base.clip_building import clip_of_points, reading
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import refuse_remote, zero_frames
from kinemimic.pipeline.readers.base.numbers import parse_table
from kinemimic.pipeline.readers.base.source import Source

FORMAT = Format(
    name="MSR Daily Activity 3D skeletons",
    sensor="Kinect v1",
    holds="positions of 20 joints, up to six people",
    recognised_by="a number of frames and 20, a number of rows (40 per person), then rows of 4 numbers",
)
# In Hz. The file has no times; this is the sensor's rate.
RATE = 30.0
_WIDTH = 4  # numbers in a row
_ROWS = 2 * len(NODES)  # of a person
_MAX_PEOPLE = 6  # of the sensor
_COUNTS = frozenset(f"{_ROWS * people}" for people in range(_MAX_PEOPLE + 1))
_MAX_FRAMES = 216_000  # two hours


def recognises(source: Source) -> bool:
    """True if a number of frames and 20 come first, then numbers of rows, and after one that is not 0, four
    numbers."""
    words = [line.split() for line in source.head]
    if len(words) < 2 or len(words[0]) != 2 or not words[0][0].isdecimal() or words[0][1] != f"{len(NODES)}":
        return False
    first = next((number for number, line in enumerate(words) if number and len(line) != 1), len(words))
    counts = [line[0] for line in words[1:first]]
    if not counts or not _COUNTS.issuperset(counts):
        return False
    return first == len(words) or len(words[first]) == _WIDTH


def read(source: Source) -> Clip:
    """The clip of the 20 nodes of one person, one frame per frame of the file, at 30 Hz.

    Of several people in a frame, the nearest to the frame before is kept. Where nobody is seen, every joint
    is missing. Raises CaptureError if the file has fewer or more rows than it states, and for damaged rows.
    """
    counts, rows = _rows(source)
    if not rows.content.strip():
        raise source.error(expected="a person", found=f"{plural(len(counts), 'frame')} without one")
    table = parse_table(rows, width=_WIDTH)
    bodies = table.values.reshape(-1, len(NODES), 2, _WIDTH)[:, :, 0, :3]
    refuse_remote(bodies, NODES, source, lambda body: f"rows from line {table.line(_ROWS * body)}")
    points, several = _one_person(bodies, counts)
    return clip_of_points(
        node_skeleton(),
        np.arange(len(points)) / RATE,
        points,
        None,
        format=FORMAT,
        reading=reading(
            units="m",
            units_rule="the format's",
            defects=[*several, *zero_frames(points)],
            notes=[f"no time in the file: {RATE:g} Hz, the sensor's rate"],
        ),
    )


def _rows(source: Source) -> tuple[list[int], Source]:
    """The number of people in each frame; and the source with their rows alone, blank lines in place of
    others."""
    filled = [number for number, line in enumerate(source.lines) if line.strip()]
    lines = list(source.lines)
    frames = int(lines[filled[0]].split()[0])
    if frames > _MAX_FRAMES:
        raise source.error(expected=f"at most {_MAX_FRAMES} frames", found=f"{frames}", line=filled[0] + 1)
    lines[filled[0]] = ""
    counts: list[int] = []
    place = 1
    for _ in range(frames):
        expected = f"a number of rows, 0 or {_ROWS} per person"
        if place >= len(filled):
            raise _cut_off(source, expected)
        number = filled[place]
        count = lines[number].strip()
        if count not in _COUNTS:
            raise source.error(
                expected=expected,
                found=repr(count[:40]),
                line=number + 1,
                advice="a row before it is missing, or one too many",
            )
        lines[number] = ""
        counts.append(int(count) // _ROWS)
        place += 1 + int(count)
    if place > len(filled):
        raise _cut_off(source, f"{_ROWS} rows of a person")
    if place < len(filled):
        raise source.error(
            expected="the end of the file after its frames",
            found=repr(lines[filled[place]].strip()[:40]),
            line=filled[place] + 1,
            advice=f"correct the number of frames in line {filled[0] + 1}",
        )
    return counts, source.with_text("\n".join(lines))


def _cut_off(source: Source, expected: str) -> CaptureError:
    return source.error(expected=expected, found="the end of the file", advice="the file is cut off there")


def _one_person(bodies: Array, counts: list[int]) -> tuple[Array, list[Defect]]:
    """Points (T, 20, 3) of one person, zeros where nobody is, and a defect for the frames with others.

    bodies: (B, 20, 3), frame by frame; counts: how many of them are in each of the T frames. A body of zeros
    is nobody.
    """
    points = np.zeros((len(counts), *bodies.shape[1:]))
    several = np.zeros(len(counts), dtype=np.bool_)
    last = None
    for frame, found in enumerate(np.split(bodies, np.cumsum(counts)[:-1])):
        seen = found[found.any(axis=(1, 2))]
        if len(seen):
            several[frame] = len(seen) > 1
            last = points[frame] = seen[0] if last is None else seen[np.argmin(_away(seen, last))]
    if not several.any():
        return points, []
    number = int(several.sum())
    text = f"{plural(number, 'frame')} with several people; the one nearest to the frame before is kept"
    return points, [Defect("several_people", number, "frames", "repaired", text, frame_runs(several))]


def _away(bodies: Array, last: Array) -> Array:
    """Mean distance (B,) in metres between the joints of bodies (B, 20, 3) and of another (20, 3)."""
    return np.asarray(np.linalg.norm(bodies - last, axis=-1).mean(axis=-1))
