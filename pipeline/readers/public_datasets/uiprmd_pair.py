"""The headerless pairs of UI-PRMD files, positions and angles, found by name; for both readers."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.readers.base.numbers import numbers_of
from kinemimic.pipeline.readers.base.source import Source


def head_of_numbers(source: Source, width: int) -> Array | None:
    """The first lines as (n, width / 3, 3), or None if one of them is not `width` comma-separated numbers.

    The last line of a head may be cut off, so it counts only if it is the only one.
    """
    lines = source.head[:-1] if len(source.head) > 1 else source.head
    rows = [row for line in lines[:16] if (row := numbers_of(line, ",")) is not None and len(row) == width]
    if len(rows) < len(lines[:16]):
        return None
    head = np.array(rows).reshape(len(rows), -1, 3)
    return np.where(np.isfinite(head), head, 0.0)


def sidecar_name(source: Source, own: str, other: str) -> str | None:
    """The source's name with `other` in place of `own`, or None if `own` is not in it."""
    name = source.path.name
    return name.replace(own, other) if own in name else None


def sidecar_file(source: Source, positions: str, angles: str, *, has_positions: bool) -> Source:
    """The file with the other half of the recording, whichever half `source` is.

    positions, angles: the words in the names that distinguish the halves. Raises CaptureError naming the
    expected file if it is missing.
    """
    own, other = (positions, angles) if has_positions else (angles, positions)
    wanted = sidecar_name(source, own, other)
    if wanted is None:
        raise source.error(
            expected=f"{own!r} in the name of this file of {own}, to find its {other} in the same folder",
            found=f"{source.path.name!r}",
        )
    sidecar = source.sidecar_file(wanted)
    if sidecar is None:
        raise source.error(
            expected=f"{wanted} with the {other} of this recording in the same folder", found="no such file"
        )
    return sidecar
