"""One matrix of all markers in a MAT-file, whose names are in a cell array beside it: two variables, or two
fields of a structure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import permutations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.readers.array_files.mat5 import Value, heads, texts, variables
from kinemimic.pipeline.readers.base.column_names import words_of
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.optical.people import has_legs

# Words of what names the markers.
_NAMES = frozenset(("label", "labels", "name", "names", "markernames", "markerlabels", "marker", "markers"))
# Words of what is no place.
_NO_PLACES = frozenset((
    "angle", "angles", "moment", "moments", "force", "forces", "power", "powers", "torque", "torques", "grf",
    "velocity", "velocities", "vel", "acceleration", "accelerations", "acc", "rotation", "rotations",
    "angular", "kinetics",
))  # fmt: skip


def named_matrix(source: Source) -> dict[str, Value] | None:
    """The variables, or a structure's fields, with a matrix (T, 3) for each marker instead of that of all.

    None without such a matrix.
    """
    for group in _groups(source):
        for names in map(texts, group.values()):
            if len(set(names)) < len(names) or not has_legs(names):
                continue
            for key, value in group.items():
                points = _points(value, len(names)) if is_place(key) else None
                if points is not None:
                    others = {one: other for one, other in group.items() if one != key}
                    return others | {name: points[:, k] for k, name in enumerate(names)}
    return None


def _groups(source: Source) -> Iterator[Mapping[str, Value]]:
    """The fields of each structure that has names, and all variables if one has."""
    known = heads(source)
    for name, head in known.items():
        if any(_NAMES & set(words_of(one)) for one in head.fields):
            value = variables(source, [name]).get(name)
            if isinstance(value, Mapping):
                yield value
    if any(head.kind in ("cell", "char") and _NAMES & set(words_of(name)) for name, head in known.items()):
        yield variables(source, list(known))


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
            if moved.shape[1] == count and moved.shape[2] in (3, 4):
                return np.asarray(moved[..., :3])
    return None
