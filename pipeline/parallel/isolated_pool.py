"""Many files over a pool of processes, of which none can harm another: each file costs at most itself.

concurrent.futures loses every pending file when one worker dies, and cannot stop one that hangs. Here each
worker has a pipe of its own: it is ended when its file takes too long, and replaced when it is gone.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import resource
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing import forkserver
from multiprocessing.connection import Connection, wait
from multiprocessing.context import ForkServerContext, ForkServerProcess
from typing import Any

# A capture of a person takes a second; a file that takes a minute, or gigabytes, is none.
SECONDS = 60.0
MEMORY = 4 * 2**30

Work = Callable[[Any], Any]


@dataclass(frozen=True)
class Failed:
    """What stands in a result's place when there is none, and why, in words."""

    reason: str


@dataclass
class _Worker:
    process: ForkServerProcess
    pipe: Connection
    item: int
    since: float


def each(
    work: Work, items: Sequence[Any], *, jobs: int, seconds: float = SECONDS, memory: int = MEMORY
) -> Iterator[tuple[int, Any]]:
    """(index, work(item)) of every item, in the sequence in which they are done.

    work: a function that a process can import; jobs: how many processes at once; seconds, memory (bytes):
    the most that one item may take. In place of a result stands `Lost` for an item that took more, whose
    process died, or that raised an exception. However the loop over it ends, no process is left behind.
    """
    context = _server()
    waiting = deque(range(len(items)))
    workers: list[_Worker] = []
    try:
        while waiting or workers:
            while waiting and len(workers) < jobs:
                workers.append(_start(context, work, memory, waiting.popleft(), items))
            yield from _finished(workers, waiting, items, seconds)
    finally:
        for worker in workers:
            _end(worker)


def _finished(
    workers: list[_Worker], waiting: deque[int], items: Sequence[Any], seconds: float
) -> Iterator[tuple[int, Any]]:
    """Wait until something happens, and hand out what is done; idle workers get the next item."""
    now = time.monotonic()
    patience = max(0.0, min(worker.since for worker in workers) + seconds - now)
    ready = set(wait([worker.pipe for worker in workers], timeout=patience))
    for worker in tuple(workers):
        result: Any
        if worker.pipe in ready:
            try:
                result = worker.pipe.recv()
            except (EOFError, OSError):
                worker.process.join(timeout=5.0)
                result = Failed(_death(worker.process.exitcode))
                workers.remove(worker)
                _end(worker)
        elif time.monotonic() - worker.since > seconds:
            result = Failed(f"given up after {seconds:g} s")
            workers.remove(worker)
            _end(worker)
        else:
            continue
        done = worker.item
        if worker in workers:
            if waiting:
                worker.item, worker.since = waiting.popleft(), time.monotonic()
                with contextlib.suppress(OSError):  # it died just now: the pipe's end will tell
                    worker.pipe.send(items[worker.item])
            else:
                workers.remove(worker)
                _end(worker)
        yield done, result


def _start(context: ForkServerContext, work: Work, memory: int, item: int, items: Sequence[Any]) -> _Worker:
    ours, theirs = context.Pipe()
    process = context.Process(target=_serve, args=(theirs, work, memory), daemon=True)
    process.start()
    theirs.close()
    with contextlib.suppress(OSError):
        ours.send(items[item])
    return _Worker(process, ours, item, time.monotonic())


def _end(worker: _Worker) -> None:
    worker.pipe.close()
    worker.process.kill()
    worker.process.join()
    worker.process.close()


def _death(code: int | None) -> str:
    if code is not None and code < 0:
        return f"its process was ended by {signal.Signals(-code).name}"
    return f"its process ended with status {code}"


def _serve(pipe: Connection, work: Work, memory: int) -> None:
    """A worker: items in, results out, until the pipe closes."""
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    # C libraries that a damaged file breaks write to stderr, into the table.
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stderr.fileno())
    with contextlib.suppress(EOFError, OSError):
        while True:
            item = pipe.recv()
            try:
                result = work(item)
            except MemoryError:
                result = Failed(f"it takes more than {memory / 2**30:g} GiB of memory")
            except Exception as error:
                result = Failed(f"a bug in kinemimic, please report it: {type(error).__name__}: {error}")
            pipe.send(result)


def _server() -> ForkServerContext:
    """The process that workers are forked from: it loads the readers once, and Ctrl-C does not reach it.

    A fork of this process itself would copy the locks of the progress bar's thread.
    """
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["kinemimic.pipeline.inspect.file_report"])
    # What is set here is what the server, and every worker, starts with: Ctrl-C is this process' to handle,
    # and a process per core leaves no core for more threads.
    threads = os.environ.get("OMP_NUM_THREADS")
    os.environ["OMP_NUM_THREADS"] = "1"
    in_main = threading.current_thread() is threading.main_thread()
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN) if in_main else None
    try:
        forkserver.ensure_running()
    finally:
        if handler is not None:
            signal.signal(signal.SIGINT, handler)
        if threads is None:
            del os.environ["OMP_NUM_THREADS"]
        else:
            os.environ["OMP_NUM_THREADS"] = threads
    return context
