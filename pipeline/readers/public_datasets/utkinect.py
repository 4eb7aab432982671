"""UTKinect-Action3D: a frame number and 20 joints x y z per line, no header; action labels in a separate
file.

The number counts images. In the data set all numbers are even, because colour and depth images of a 30 Hz
camera are counted one by one: 60 in a second. Its authors state about 15 frames a second, and there are 10 to
19. With 30 numbers in a second there would be half as many, and people would walk at 0.4 m/s, with 30 to 60
steps in a minute. There is a line for every second to eighth number, and sometimes two with one number: two
updates of the tracker within one image, or two people. Metres, Y up, no tracking state.
"""

from __future__ import annotations

import re
from itertools import product

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip, Label
from kinemimic.pipeline.kinematics.skeleton import NODES, node_skeleton
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.readers.base.body_posture import is_upright_body
from kinemimic.pipeline.readers.base.clip_building import clip_of_points, reading
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import increasing_times, refuse_remote, zero_frames
from kinemimic.pipeline.readers.base.numbers import numbers_of, parse_table
from kinemimic.pipeline.readers.base.source import Source

WIDTH = 1 + 3 * len(NODES)
FORMAT = Format(
    name="UTKinect lines",
    sensor="Kinect v1",
    holds="positions of 20 joints",
    recognised_by="lines of 61 numbers: a frame number that never decreases, then an upright body",
    columns=(WIDTH,),
)
RATE = 30.0  # of the camera, Hz
LABELS = "actionLabel.txt"
# In metres. Two updates of one body within an image are centimetres apart; two people are further apart than
# this.
_PEOPLE_DISTANCE = 0.3
# Number of lines with one frame number that are considered.
_MAX_CANDIDATES = 6
# Images between the lines of the data set: up to eight.
_LARGEST_STEP = 12.0
_TAKE = re.compile(r"s\d+_e\d+")
_LABEL = re.compile(r"\s*(\w+)\s*:\s*(\S+)\s+(\S+)\s*$")


def recognises(source: Source) -> bool:
    """True if lines are 61 numbers, the first an integer that never decreases, the others an upright body."""
    rows: list[list[float]] = []
    # The last line of the head may be cut off.
    for line in source.head[:-1] if len(source.head) > 1 else source.head:
        row = numbers_of(line, None)
        if row is None or len(row) != WIDTH:
            return False
        rows.append(row)
    table = np.array(rows)
    if not np.isfinite(table).all():
        return False
    numbers = table[:, 0]
    steps = np.diff(numbers)
    whole = (numbers >= 0).all() and (numbers == np.rint(numbers)).all() and (steps >= 0).all()
    # Larger ones are times.
    whole &= not (steps > 0).any() or np.median(steps[steps > 0]) <= _LARGEST_STEP
    return bool(whole) and is_upright_body(table[:, 1:].reshape(-1, len(NODES), 3))


def read(source: Source) -> Clip:
    """The clip of the 20 nodes; times are frame numbers over 60, or over 30 if one of them is odd.

    Of lines with the same number, the nearest to the line before is kept: the first of two updates, and the
    same person if there are two.
    """
    table = parse_table(source, width=WIDTH)
    numbers = table.values[:, 0]
    wrong = ~((np.abs(numbers) < 1e9) & (numbers == np.rint(numbers)))
    if wrong.any():
        row = int(np.argmax(wrong))
        raise source.error(expected="a frame number", found=f"{numbers[row]:g}", line=table.line(row))
    points = table.values[:, 1:].reshape(-1, len(NODES), 3)
    refuse_remote(points, NODES, source, table.where)
    if not np.isfinite(points).all():
        points = np.where(np.isfinite(points), points, np.nan)
    rows, defects = _one_of_each(numbers, points)
    rate = RATE if (numbers % 2.0).any() else 2.0 * RATE
    labels, notes = _labels(source, rate)
    return clip_of_points(
        node_skeleton(),
        numbers[rows] / rate,
        points[rows],
        None,
        format=FORMAT,
        reading=reading(
            units="m",
            units_rule="the format's",
            defects=[*defects, *zero_frames(points[rows])],
            notes=notes,
        ),
        labels=labels,
    )


def _one_of_each(numbers: Array, points: Array) -> tuple[NDArray[np.intp], list[Defect]]:
    """The rows to keep, one per frame number, and the defects of the others."""
    later, defects = increasing_times(numbers)
    if not defects:
        return np.arange(len(numbers)), []
    # Rows with a number below the latest one are late; they are not considered.
    current = np.flatnonzero(numbers == np.maximum.accumulate(numbers))
    bodies, first = points[current], np.flatnonzero(later[current])
    sizes = np.diff(np.append(first, len(current)))
    distances = _mean_distance(bodies, bodies[np.repeat(first, sizes)])
    frames = np.repeat(np.arange(len(first)), sizes)
    two_people = np.unique(frames[np.isfinite(distances) & (distances > _PEOPLE_DISTANCE)])
    rows = current[_nearest(bodies, first, sizes)]
    count = len(numbers) - len(rows)
    text = f"{count} lines with a repeated frame number, dropped: the nearest to the previous frame is kept"
    found = [Defect("duplicate_frames", count, "frames", "repaired", text)]
    if defects[0].action == "flagged":
        found = defects
    if len(two_people):
        spans = tuple((int(frame), int(frame)) for frame in two_people[:100])
        text = (
            f"{len(two_people)} frame numbers have lines more than {_PEOPLE_DISTANCE:g} m apart: two people; "
            "the one nearest to the previous frame is kept"
        )
        found.append(Defect("several_people", len(two_people), "frames", "repaired", text, spans))
    return rows, found


def _nearest(bodies: Array, first: NDArray[np.intp], sizes: NDArray[np.intp]) -> list[int]:
    """For each frame, bodies[first : first + size], the one nearest to the one chosen in the frame before.

    Each choice depends on the one before. All distances that may be needed are computed in advance, by the
    number of rows between the two bodies, and then only looked up. More than _MAX_CANDIDATES bodies are not
    considered: no sensor sees that many.
    """
    candidates = np.minimum(sizes, _MAX_CANDIDATES)
    chosen: list[int] = first.tolist()
    ambiguous = np.flatnonzero(candidates > 1)
    ambiguous = ambiguous[ambiguous > 0]
    distance: dict[tuple[int, int], float] = {}
    for candidate, previous in product(range(_MAX_CANDIDATES), repeat=2):
        frames = ambiguous[(candidates[ambiguous] > candidate) & (candidates[ambiguous - 1] > previous)]
        here, before = first[frames] + candidate, first[frames - 1] + previous
        distance |= zip(
            zip(here.tolist(), before.tolist(), strict=True),
            _mean_distance(bodies[here], bodies[before]).tolist(),
            strict=True,
        )
    for frame in ambiguous.tolist():
        last, start = chosen[frame - 1], chosen[frame]
        chosen[frame] = min(range(start, start + int(candidates[frame])), key=lambda k: distance[k, last])
    return chosen


def _mean_distance(bodies: Array, others: Array) -> Array:
    """Mean distance (K,) in metres between the joints of bodies (K, 20, 3) and of others; infinite if
    undefined."""
    difference = bodies - others
    distance = np.sqrt(np.einsum("kji,kji->kj", difference, difference)).mean(axis=-1)
    return np.where(np.isfinite(distance), distance, np.inf)


def _labels(source: Source, rate: float) -> tuple[list[Label], list[str]]:
    """Actions of this take from the label file in the same folder, which gives their first and last frame;
    rate: frame numbers in a second.

    A label without frames (NaN), or one that cannot be read, gives a note: labels are optional.
    """
    take = _TAKE.search(source.path.name)
    label_source = source.sidecar_file(LABELS) if take else None
    if take is None or label_source is None:
        return [], []
    labels: list[Label] = []
    notes: list[str] = []
    inside = False
    for line in label_source.lines:
        if _TAKE.fullmatch(line.strip()):
            inside = line.strip() == take.group()
        elif inside and line.strip():
            match = _LABEL.match(line)
            frames = [_frame_number(match.group(k)) for k in (2, 3)] if match else []
            first, last = frames if frames else (None, None)
            if match is None or first is None or last is None or last < first:
                notes.append(f"{LABELS} has no frames for {line.strip()[:40]!r}")
                continue
            labels.append(Label(match.group(1), first / rate, last / rate))
    if not labels:
        notes.append(f"{LABELS} has no action of {take.group()}")
    return labels, notes


def _frame_number(text: str) -> int | None:
    return int(text) if text.isascii() and text.isdigit() and len(text) < 10 else None
