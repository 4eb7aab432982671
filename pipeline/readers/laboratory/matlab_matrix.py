"""One matrix of all markers in a MAT-file, whose names are in a cell array beside it: two variables, or two
fields of a structure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import permutations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.readers.array_files.mat5 import Value, heads, texts, variables
from kinemimic.pipeline.readers.base.column_names import words_of
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.optical.people import has_legs

# Words of what names the markers.
_NAMES = frozenset(("label", "labels", "name", "names", "markernames", "markerlabels", "marker", "markers"))
PLACES = frozenset((
    "marker", "markers", "point", "points", "position", "positions", "trajectories", "joints", "skeleton",
))  # fmt: skip
# Words in the names of what is not a position.
_NO_PLACES = frozenset((
    "angle", "angles", "moment", "moments", "force", "forces", "power", "powers", "torque", "torques", "grf",
    "velocity", "velocities", "vel", "acceleration", "accelerations", "acc", "rotation", "rotations",
    "angular", "kinetics", "orientation", "orientations", "quaternion", "quaternions", "quat", "quats",
    "euler", "jerk", "residual", "residuals", "error", "errors", "std", "sd",
))  # fmt: skip


def named_matrix(source: Source) -> dict[str, Value] | None:
    """The variables, or a structure's fields, with (T, 3) for each marker in place of the matrix of all.

    None without such a matrix, and in a damaged file.
    """
    try:
        return next((found for group in _groups(source) if (found := _separated(group)) is not None), None)
    except CaptureError:
        return None


def _separated(group: Mapping[str, Value]) -> dict[str, Value] | None:
    for labels in map(texts, group.values()):
        names = [label.strip() for label in labels]
        if not has_legs(names):
            continue
        found = {
            key: points
            for key, value in group.items()
            if is_place(key) and (points := _points(value, len(names))) is not None
        }
        if found:
            key = min(found, key=lambda one: not PLACES & set(words_of(one)))
            others = {one: value for one, value in group.items() if one != key}
            markers = {name: found[key][:, k] for k, name in reversed(list(enumerate(names))) if name}
            return others | markers  # of two with one name, the first
    return None


def _groups(source: Source) -> Iterator[Mapping[str, Value]]:
    """The fields of each structure that has names, and the variables of text and of numbers if one has."""
    known = heads(source)
    for name, head in known.items():
        if any(_NAMES & set(words_of(one)) for one in head.fields):
            value = variables(source, [name]).get(name)
            if isinstance(value, Mapping):
                yield value
    lists = [name for name, head in known.items() if head.kind in ("cell", "char")]
    if any(has_legs(texts(value)) for value in variables(source, lists).values()):
        yield variables(source, [*lists, *(name for name, head in known.items() if head.kind == "number")])


def is_place(name: str) -> bool:
    """Whether a variable or field may hold positions, by its name."""
    return not _NO_PLACES & set(words_of(name))


def _points(matrix: Value, count: int) -> Array | None:
    """Points (T, count, 3) of a matrix of frames, markers and axes in any order; None for another one.

    Two dimensions: x, y, z of one marker after the other.
    """
    if not isinstance(matrix, np.ndarray):
        return None
    if matrix.ndim == 2 and 3 * count in matrix.shape:
        rows = matrix if matrix.shape[1] == 3 * count else matrix.T
        return np.asarray(rows.reshape(len(rows), count, 3))
    if matrix.ndim == 3:
        for order in permutations(range(3)):
            moved = matrix.transpose(order)
            if moved.shape[1:] == (count, 3):
                return np.asarray(moved)
    return None
