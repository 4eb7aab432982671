"""The two files of one recording, found by a word in their names: positions here, angles there."""

from __future__ import annotations

from kinemimic.pipeline.readers.base.source import Source


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
