"""The sources of a batch: files, folders, patterns, names of the catalogue, and lists of these."""

from __future__ import annotations

import glob
import os
from collections.abc import Iterator, Sequence
from pathlib import Path

from kinemimic.evaluate.batch.state import place_of
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.validation.bounded import MEGABYTE
from kinemimic.pipeline.files.validation.toml_file import read_text
from kinemimic.pipeline.readers.search import find_files

_LIST = "@"
_LIST_LIMIT = 64 * MEGABYTE
_DEPTH = 8  # of lists that name lists
_EXPECTED = "expected a capture or a folder of captures"


def paths_of(sources: Sequence[str | Path]) -> list[Path]:
    """The files and folders that are meant.

    A source is a path, a pattern (`walks/**/*.bvh`), `COLLECTION` or `COLLECTION/FILE` of the catalogue,
    whose files must have been fetched, or `@FILE`, a text file with a source on each line (empty lines and
    lines that begin with # are ignored; paths in it are relative to the current folder, like all others).
    An existing path takes precedence over a catalogue entry of the same name.
    KinemimicError for a source that is none of these, naming the line of a list.
    """
    return [path for source in sources for path in _paths(str(source), str(source), 0)]


def _paths(source: str, place: str, depth: int) -> Iterator[Path]:
    if os.path.lexists(source):
        yield Path(source)
    elif source.startswith(_LIST):
        yield from _listed(Path(source.removeprefix(_LIST)), depth)
    elif glob.has_magic(source):
        found = [Path(name) for name in sorted(glob.iglob(source, recursive=True))]  # noqa: PTH207
        if not found:
            raise KinemimicError(f"{place}: {_EXPECTED}, found nothing that matches the pattern")
        yield from found
    else:
        yield from _of_catalog(source, place)


def _listed(file: Path, depth: int) -> Iterator[Path]:
    if depth >= _DEPTH:
        raise KinemimicError(
            f"{file}: expected sources, found lists nested more than {_DEPTH} deep, or one that names itself"
        )
    lines = read_text(file, _LIST_LIMIT, "a list of sources").splitlines()
    for number, line in enumerate(lines, start=1):
        if (source := line.strip()) and not source.startswith("#"):
            yield from _paths(source, f"{file}, line {number}: {source}", depth + 1)


def _of_catalog(source: str, place: str) -> Iterator[Path]:
    # Import cost: most sources are paths.
    from kinemimic.pipeline.catalog.load import load_catalog  # noqa: PLC0415
    from kinemimic.pipeline.catalog.local_files import captures_folder, is_present  # noqa: PLC0415

    try:
        entries = load_catalog().select([source])
    except KinemimicError:
        raise KinemimicError(
            f"{place}: {_EXPECTED}, found neither a file nor a name in the catalogue "
            "(`kinemimic datasets list`)"
        ) from None
    folder = captures_folder()
    for entry in entries:
        if not is_present(entry, folder):
            raise KinemimicError(
                f"{place}: expected a file of the catalogue in {folder}, found that {entry.name} is missing; "
                f"run `kinemimic datasets fetch {source}`"
            )
        if entry.format is not None:
            yield folder / entry.collection / entry.file


def run_folders(sources: Sequence[Path], out: Path) -> dict[Path, Path]:
    """The files at `sources`, except those below `out`, and their run folders.

    A run folder has the path of its file, below `out` instead of the folder that all sources share. A file
    that two sources name differently is there once.
    KinemimicError for a source that does not exist.
    """
    for source in sources:
        if not source.exists():
            raise KinemimicError(f"{source}: {_EXPECTED}, found nothing there")
    files = find_files(sources)
    if not files:
        return {}
    # A depth recording is a folder that counts as a file.
    found = {*files}
    roots = (source if source.is_dir() and source not in found else source.parent for source in sources)
    shared = os.path.commonpath([place_of(root) for root in roots])
    own = place_of(out)
    places = {place_of(file): file for file in reversed(files)}  # the first of several is kept
    return {
        file: out / _below(place, shared)
        for place, file in reversed(places.items())
        if not place.is_relative_to(own)
    }


def _below(place: Path, shared: str) -> Path:
    """The path of a file below the folder that all sources share; KinemimicError if it leads out of it."""
    path = Path(os.path.relpath(place, shared))
    if ".." in path.parts:
        raise KinemimicError(
            f"{place}: expected a file below {shared}, found one elsewhere; name it by itself"
        )
    return path
