"""The two files of one recording, found by a word in their names: positions here, angles there.

Both are in one folder, or in two beside each other that are named after the halves (Positions, Angles).
"""

from __future__ import annotations

from kinemimic.pipeline.readers.base.source import Source


def other_half(source: Source, own: str, other: str) -> Source | None:
    """The file whose name has `other` in place of the source's `own`, or None if there is none."""
    found = (source.sidecar_file(name) for name in _names(source, own, other))
    return next((half for half in found if half is not None), None)


def required_half(source: Source, own: str, other: str) -> Source:
    """As `other_half`; CaptureError naming the expected file if it is missing."""
    half = other_half(source, own, other)
    if half is None:
        names = _names(source, own, other)
        if not names:
            raise source.error(
                expected=f"{own!r} in the name of this file of {own}, to find its {other} in the same folder",
                found=f"{source.path.name!r}",
            )
        raise source.error(
            expected=f"{' or '.join(names)} with the {other} of this recording", found="no such file"
        )
    return half


def _names(source: Source, own: str, other: str) -> list[str]:
    """Where the other half may be, relative to the source's folder."""
    name = source.path.name
    if own not in name:
        return []
    renamed = name.replace(own, other)
    folder = {own: other, own.capitalize(): other.capitalize()}.get(source.path.absolute().parent.name)
    return [renamed, *([f"../{folder}/{renamed}"] if folder else [])]
