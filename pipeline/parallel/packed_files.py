"""Files as bytes, for a machine that shares no disk: read here, written there.

What comes from another machine is not trusted: names that lead out of their folder, and more than a limit,
are refused before anything is written.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import atomic
from kinemimic.pipeline.files.validation.bounded import MEGABYTE, read_bounded

# Of one task: a depth recording of ten minutes has 18,000 images of 60 kB.
MOST_FILES = 50_000
MOST_BYTES = 2048 * MEGABYTE
_NAME_BYTES = 255  # of a file name, which file systems allow

PackedFiles = Mapping[str, bytes]  # path below a folder, with slashes -> content


def read_files(files: Mapping[str, Path]) -> dict[str, bytes]:
    """The content of files by name.

    KinemimicError for more than MOST_FILES or MOST_BYTES in all, and for a pipe or device; OSError for a file
    that cannot be read.
    """
    _require_count(len(files))
    found: dict[str, bytes] = {}
    left = MOST_BYTES
    for name, path in files.items():
        found[name] = read_bounded(path, left, "files for another machine, in all")
        left -= len(found[name])
    return found


def read_folder(folder: Path) -> dict[str, bytes]:
    """As `read_files`, of everything below a folder; KinemimicError for a link, which may lead out of it."""
    found: dict[str, Path] = {}
    for path in sorted(folder.rglob("*")):
        if path.is_symlink():
            raise KinemimicError(f"{path}: expected a file, found a link; replace it by what it leads to")
        if not path.is_dir():
            found[path.relative_to(folder).as_posix()] = path
    return read_files(found)


def write_files(folder: Path, files: PackedFiles, *, last: Callable[[str], bool] | None = None) -> None:
    """Write files below a folder, each atomically.

    last: whether a file is written after the others, because it marks them as complete. KinemimicError, with
    nothing written, for a name that is absolute, has a part like "..", or leads through a link, and for more
    than MOST_FILES or MOST_BYTES; OSError where a file cannot be written.
    """
    _require_count(len(files))
    if (size := sum(map(len, files.values()))) > MOST_BYTES:
        raise KinemimicError(
            f"{folder}: expected at most {MOST_BYTES // MEGABYTE:,} MB from another machine, found "
            f"{size // MEGABYTE:,}"
        )
    for name in files:
        _require_inside(folder, name)
    for name in files if last is None else sorted(files, key=last):
        with atomic(folder / name) as temporary:
            temporary.write_bytes(files[name])


def _require_count(count: int) -> None:
    if count > MOST_FILES:
        raise KinemimicError(
            f"expected at most {MOST_FILES:,} files to and from another machine, found {count:,}"
        )


def _require_inside(folder: Path, name: str) -> None:
    """KinemimicError unless `name` is a path below the folder that meets no link."""
    parts = name.split("/")
    if any(part in ("", ".", "..") or "\0" in part or _too_long(part) for part in parts):
        raise KinemimicError(
            f"{folder}: expected names of files below it from another machine, found {name!r:.300}; nothing "
            "is written"
        )
    for place in _places(folder, parts):
        if place.is_symlink():
            raise KinemimicError(
                f"{place}: expected a file or a folder, to write {name!r} from another machine, found a link"
            )


def _too_long(part: str) -> bool:
    return len(part.encode("utf-8", "surrogateescape")) > _NAME_BYTES


def _places(folder: Path, parts: list[str]) -> Iterator[Path]:
    """The paths below the folder that lead to a file, and the file's own."""
    place = folder
    for part in parts:
        place /= part
        yield place
