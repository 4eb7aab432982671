"""Where recordings lie on this machine: the folder, and a file's place in it, which never leads out of it."""

from __future__ import annotations

import os
from pathlib import Path

from kinemimic.pipeline.catalog.entry import Entry
from kinemimic.pipeline.errors import KinemimicError

VARIABLE = "KINEMIMIC_CAPTURES"


def captures_folder(named: Path | None = None) -> Path:
    """The folder of recordings, COLLECTION/FILE within: `named`, else that of KINEMIMIC_CAPTURES, else the
    user's cache. It need not exist."""
    if named is not None:
        return named
    if told := os.environ.get(VARIABLE):
        return Path(told)
    import pooch  # noqa: PLC0415 (only to know where caches are)

    return Path(pooch.os_cache("kinemimic")) / "captures"


def target_path(entry: Entry, folder: Path) -> Path:
    """Where a file may be written: below `folder`, and below nothing that leads elsewhere.

    A KinemimicError for names that are no plain ones, links that lead out of the folder, and for what is
    there and is no file.
    """
    root = folder.resolve()
    path = root / entry.collection / entry.file
    if path.parent.parent != root or {"..", "."} & {entry.collection, entry.file}:
        raise KinemimicError(f"{entry.name!r}: expected a file in a folder, found what leads elsewhere")
    for part in (path.parent, path):
        if not part.resolve().is_relative_to(root):
            raise KinemimicError(
                f"{part}: expected a place within {root}, found a link to {part.resolve()}; remove the link"
            )
    if path.exists() and not path.is_file():
        raise KinemimicError(f"{path}: expected a file or nothing, found something else")
    return path


def is_present(entry: Entry, folder: Path) -> bool:
    """Whether a file of the right size is there; `verify` looks closer."""
    try:
        return (folder / entry.collection / entry.file).stat().st_size == entry.bytes
    except OSError:
        return False
