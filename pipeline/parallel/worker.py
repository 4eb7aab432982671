"""One worker process with a pipe: start, send, receive, notice its death, end with its parent."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from typing import Any

from kinemimic.pipeline.errors import KinemimicError


class WorkerDiedError(Exception):
    """The process of a worker ended before it answered; exitcode: -N if signal N killed it."""

    def __init__(self, exitcode: int | None) -> None:
        super().__init__(f"its process ended with status {exitcode}")
        self.exitcode = exitcode

    def among(self, count: int) -> KinemimicError:
        """The error to report when one of `count` workers died."""
        return KinemimicError(
            f"expected {count} worker processes, found that one ended, status {self.exitcode}; "
            "if it was killed (-9), memory may be short: use fewer --workers"
        )


class Worker:
    """A process that starts idle; `begin` starts its work.

    The two steps are separate because a pipe holds little data: sending to a process that is still importing
    its modules blocks. Start all workers first, so that they import in parallel.

    preload: a module for a fork server to import once, for workers that must start fast; without it each
    process is spawned. daemon: False for a worker that itself starts processes.
    """

    def __init__(self, *, preload: str | None = None, daemon: bool = True) -> None:
        context: Any = multiprocessing.get_context("spawn" if preload is None else "forkserver")
        if preload is not None:
            context.set_forkserver_preload([preload])
        self.pipe: Connection
        self.pipe, theirs = context.Pipe()
        self._process = context.Process(target=_run, args=(theirs,), daemon=daemon)
        with worker_environment():
            self._process.start()
        theirs.close()

    def begin(self, serve: Callable[..., object], *arguments: Any) -> None:
        """Let the worker call serve(pipe, *arguments), a function at a module's top level, and then end."""
        self.send((serve, arguments))

    def send(self, message: Any) -> None:
        """Send to the worker; if it has died, the next `receive` says so."""
        with contextlib.suppress(ConnectionError):
            self.pipe.send(message)

    def receive(self) -> Any:
        """The next message of the worker; WorkerDiedError if its process ended without one."""
        try:
            return self.pipe.recv()
        except (EOFError, ConnectionError):
            self._process.join()
            raise WorkerDiedError(self._process.exitcode) from None

    def terminate(self) -> None:
        """Send SIGTERM."""
        self._process.terminate()

    def end(self, patience: float | None = 0.0) -> None:
        """Close the pipe, wait up to `patience` seconds (None: without limit), then kill the process."""
        self.pipe.close()
        self._process.join(patience)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()


def _run(pipe: Connection) -> None:
    """The worker's process."""
    _end_with_parent()
    with contextlib.suppress(EOFError, ConnectionError):  # the parent closed the pipe
        serve, arguments = pipe.recv()
        serve(pipe, *arguments)


def _end_with_parent() -> None:
    """End this process when its parent ends, even in the middle of its work."""
    parent = multiprocessing.parent_process()

    def watch() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


@contextmanager
def worker_environment() -> Iterator[None]:
    """Processes started within this context run matrix products in one thread and ignore Ctrl-C and SIGHUP.

    One thread, because there is one process per core. Both signals reach the whole process group; the parent
    handles them, from the worker's first import on.
    """
    saved = {name: os.environ.get(name) for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")}
    os.environ |= dict.fromkeys(saved, "1")
    in_main = threading.current_thread() is threading.main_thread()  # only it may set handlers
    shared = (signal.SIGINT, signal.SIGHUP) if in_main else ()
    handlers = {number: signal.signal(number, signal.SIG_IGN) for number in shared}
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        for name in saved:
            del os.environ[name]
        os.environ |= {name: value for name, value in saved.items() if value is not None}
