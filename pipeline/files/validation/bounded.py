"""Read untrusted files: regular files only, up to a size limit, as long as data arrive."""

from __future__ import annotations

import os
import queue
import stat
import threading
from io import FileIO
from pathlib import Path

from kinemimic.pipeline.errors import CaptureError, KinemimicError

MEGABYTE = 1 << 20
# Seconds without data after which a file counts as unreadable: a file on a dead network mount may block
# any call indefinitely. A slow disk delivers a megabyte in less.
STALLED = 20.0


def require_regular(path: Path, kind: str) -> None:
    """KinemimicError for a folder, pipe or device in place of `kind`; reading a pipe may block indefinitely.

    A missing file passes; opening it raises the proper error.
    """
    if path.is_file() or not path.exists():
        return
    raise _not_regular(path, kind, path.stat().st_mode)


def read_bounded(path: Path, limit: int, kind: str) -> bytes:
    """The content of a regular file of at most `limit` bytes; kind: its description in errors ("a motion").

    KinemimicError if it is larger, not a regular file, or delivers nothing for STALLED seconds; OSError as
    from `open`. A file that states a size of 0 is empty: those of /proc may block or never end.
    """
    parts: queue.SimpleQueue[bytes | BaseException] = queue.SimpleQueue()
    # A thread, because nothing else ends a call that blocks in the kernel; as a daemon, it ends with us.
    threading.Thread(target=_read, args=(path, limit, kind, parts), daemon=True).start()
    content: list[bytes] = []
    while True:
        try:
            part = parts.get(timeout=STALLED)
        except queue.Empty:
            raise CaptureError(
                path,
                expected=kind,
                found=f"no data for {STALLED:g} s",
                advice="copy the file to a local disk",
            ) from None
        if isinstance(part, BaseException):
            raise part
        if not part:
            return b"".join(content)
        content.append(part)


def _read(path: Path, limit: int, kind: str, parts: queue.SimpleQueue[bytes | BaseException]) -> None:
    """Put the file's content in parts, then an empty one; or an exception."""
    try:
        if not stat.S_ISREG(mode := path.stat().st_mode):
            raise _not_regular(path, kind, mode)
        # A pipe may have taken the file's place since; without O_NONBLOCK, opening it would block.
        with FileIO(os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)) as stream:
            status = os.fstat(stream.fileno())
            if not stat.S_ISREG(status.st_mode):
                raise _not_regular(path, kind, status.st_mode)
            # One byte more than allowed detects a larger file, regardless of the size that it reports.
            left = limit + 1 if status.st_size else 0
            while left and (part := stream.read(min(8 * MEGABYTE, left))):
                parts.put(part)
                left -= len(part)
        if not left and status.st_size:
            raise CaptureError(
                path, expected=f"{kind} of at most {limit / MEGABYTE:g} MB", found="a larger file"
            )
        parts.put(b"")
    except BaseException as error:
        parts.put(error)


def _not_regular(path: Path, kind: str, mode: int) -> KinemimicError:
    found = "a folder" if stat.S_ISDIR(mode) else "a pipe or a device"
    return CaptureError(path, expected=kind, found=found)
