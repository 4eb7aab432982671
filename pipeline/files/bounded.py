"""Read untrusted files: regular files only, up to a size limit."""

from __future__ import annotations

from pathlib import Path

from kinemimic.pipeline.errors import KinemimicError

MEGABYTE = 1 << 20


def require_regular(path: Path, kind: str) -> None:
    """KinemimicError for a folder, pipe or device in place of `kind`; reading a pipe may block indefinitely.

    A missing file passes; opening it raises the proper error.
    """
    if path.is_file() or not path.exists():
        return
    found = "a folder" if path.is_dir() else "a pipe or a device"
    raise KinemimicError(f"{path}: expected {kind}, found {found}")


def read_bounded(path: Path, limit: int, kind: str) -> bytes:
    """The content of a regular file of at most `limit` bytes; kind: its description in errors ("a motion").

    KinemimicError if it is larger or not a regular file; OSError as from `open`.
    """
    require_regular(path, kind)
    with path.open("rb") as stream:
        # Reading one byte more than allowed detects a larger file, regardless of the size that it reports.
        content = stream.read(limit + 1)
    if len(content) > limit:
        raise KinemimicError(
            f"{path}: expected {kind} of at most {limit / MEGABYTE:g} MB, found a larger file"
        )
    return content
