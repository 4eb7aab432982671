"""Processes of ours: what they are born with, and tasks spread over them."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import TypeVar

from kinemimic.pipeline.errors import KinemimicError

Task = TypeVar("Task")
Result = TypeVar("Result")


@contextmanager
def inherited() -> Iterator[None]:
    """What is set in here is what a child starts with, and what is put back behind it.

    No threads for matrix products: there is a process for every core. And Ctrl-C, which reaches the whole
    process group, is the parent's to handle from the child's first import on.
    """
    saved = {name: os.environ.get(name) for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")}
    os.environ |= dict.fromkeys(saved, "1")
    in_main = threading.current_thread() is threading.main_thread()  # no other thread may set a handler
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN) if in_main else None
    try:
        yield
    finally:
        if handler is not None:
            signal.signal(signal.SIGINT, handler)
        for name in saved:
            del os.environ[name]
        os.environ |= {name: value for name, value in saved.items() if value is not None}


def spread(
    work: Callable[[Task], Result],
    tasks: Sequence[Task],
    *,
    workers: int | None = None,
    progress: Callable[[int], object] | None = None,
) -> list[Result]:
    """Results of all tasks, in their order, from `workers` processes (all cores by default).

    work: a function of a module's top level; progress: called with the number of tasks that are done.
    KinemimicError if a process was killed.
    """
    count = min(workers or len(os.sched_getaffinity(0)), len(tasks))
    results: list[Result] = []
    others = set(multiprocessing.active_children())
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(count, mp_context=context, initializer=end_with_parent) as pool:
        with inherited():
            done = pool.map(work, tasks)
        try:
            for result in done:
                results.append(result)
                if progress is not None:
                    progress(1)
        except BrokenProcessPool:
            raise KinemimicError(
                f"expected {count} processes that simulate, found that one was ended from outside; if it was "
                "killed, memory may be short: take fewer --workers"
            ) from None
        except BaseException:
            # Interrupted, nobody waits for what has begun, and nothing else begins.
            for child in set(multiprocessing.active_children()) - others:
                child.terminate()
            raise
    return results


def end_with_parent() -> None:
    """Let this process end with its parent: a killed one closes no queue, and it would wait for ever."""
    parent = multiprocessing.parent_process()

    def watch() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
