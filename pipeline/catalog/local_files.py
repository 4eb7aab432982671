"""The local folder of recordings, and the path of a file in it, which never points outside."""

from __future__ import annotations

import os
from pathlib import Path

from kinemimic.pipeline.catalog.entry import Entry
from kinemimic.pipeline.errors import KinemimicError

VARIABLE = "KINEMIMIC_CAPTURES"


def captures_folder(named: Path | None = None) -> Path:
    """The folder of recordings (COLLECTION/FILE): `named`, KINEMIMIC_CAPTURES, or the user's cache.

    It need not exist.
    """
    if named is not None:
        return named
    if variable := os.environ.get(VARIABLE):
        return Path(variable)
    import pooch  # noqa: PLC0415 (import cost)

    return Path(pooch.os_cache("kinemimic")) / "captures"


def target_path(entry: Entry, folder: Path) -> Path:
    """The path to write a file to, always inside `folder`.

    KinemimicError for names with path components, links that lead out of the folder, and an existing path
    that is not a file.
    """
    root = folder.resolve()
    path = root / entry.collection / entry.file
    if path.parent.parent != root or {"..", "."} & {entry.collection, entry.file}:
        raise KinemimicError(f"{entry.name!r}: expected a folder and a file name, found another path")
    for part in (path.parent, path):
        if not part.resolve().is_relative_to(root):
            raise KinemimicError(
                f"{part}: expected a path inside {root}, found a link to {part.resolve()}; remove the link"
            )
    if path.exists() and not path.is_file():
        raise KinemimicError(f"{path}: expected a file or an unused name, found something else")
    return path


def is_present(entry: Entry, folder: Path) -> bool:
    """Whether a file of the right size is present; `verify` compares hashes."""
    try:
        return (folder / entry.collection / entry.file).stat().st_size == entry.bytes
    except OSError:
        return False
