"""Reading what anybody may have put there: regular files only, and no more of them than memory can bear."""

from __future__ import annotations

from pathlib import Path

from kinemimic.pipeline.errors import KinemimicError

MEGABYTE = 1 << 20


def require_regular(path: Path, kind: str) -> None:
    """KinemimicError for a folder, pipe or device where `kind` should be; a pipe's reader may wait for ever.

    What does not exist passes: whoever opens it next knows what to say.
    """
    if path.is_file() or not path.exists():
        return
    found = "a folder" if path.is_dir() else "a pipe or a device"
    raise KinemimicError(f"{path}: expected {kind}, found {found}")


def read_bounded(path: Path, limit: int, kind: str) -> bytes:
    """The bytes of a regular file of at most `limit` of them; kind: what it holds, for people ("a motion").

    KinemimicError for a larger one, and for what is no regular file; OSError as `open` raises it.
    """
    require_regular(path, kind)
    with path.open("rb") as stream:
        # One more than may be there tells a file that is too large, whatever size it claims to have.
        content = stream.read(limit + 1)
    if len(content) > limit:
        raise KinemimicError(
            f"{path}: expected {kind} of at most {limit / MEGABYTE:g} MB, found a larger file"
        )
    return content
