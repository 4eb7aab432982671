"""One command at a time in a run folder."""

from __future__ import annotations

import errno
import fcntl
import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from kinemimic.pipeline.errors import KinemimicError

# Resolved folder -> how many times this process holds it: `run` calls the stages in its own process.
_held: dict[Path, int] = {}
_guard = threading.Lock()
_UNSUPPORTED = (errno.EOPNOTSUPP, errno.ENOLCK, errno.ENOSYS)


@contextmanager
def locked(run: Path, *, make: bool = True) -> Iterator[None]:
    """Hold the run folder; KinemimicError if another process holds it.

    make: make the folder if needed; otherwise, KinemimicError without one.

    The operating system releases the lock of a process that ends, however it ends. A folder that was made
    here and is still empty at the end is removed.
    """
    made = not run.exists()
    if made and not make:
        raise KinemimicError(f"{run}: expected a run folder, found none; choose one with --run")
    run.mkdir(parents=True, exist_ok=True)
    folder = run.resolve()
    with _guard:
        handle = None if _held.get(folder) else _lock(run)
        _held[folder] = _held.get(folder, 0) + 1
    try:
        yield
    finally:
        with _guard:
            _held[folder] -= 1
        if made:
            # While it is held: nobody else may have begun to use it.
            with suppress(OSError):  # not empty
                run.rmdir()
        if handle is not None:
            os.close(handle)


def _lock(run: Path) -> int:
    """A descriptor of the folder that holds the lock."""
    while True:
        handle = _locked_folder(run)
        # The command that held it before may have removed it in between.
        with suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(handle), run.stat()):
                return handle
        os.close(handle)
        run.mkdir(parents=True, exist_ok=True)


def _locked_folder(run: Path) -> int:
    """A descriptor that holds the lock of what was at `run` when it was opened."""
    handle = os.open(run, os.O_RDONLY | os.O_DIRECTORY)
    try:
        with where_supported():
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(handle)
        raise KinemimicError(
            f"{run}: expected a free run folder, found one in use by another kinemimic command; "
            "wait until it has finished, or choose another --run"
        ) from None
    except OSError:
        os.close(handle)
        raise
    return handle


@contextmanager
def where_supported() -> Iterator[None]:
    """Around a call that locks: go on without where there are no locks, as on some network file systems."""
    try:
        yield
    except OSError as error:
        if error.errno not in _UNSUPPORTED:
            raise
