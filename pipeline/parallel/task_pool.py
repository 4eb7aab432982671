"""A function mapped over tasks by a pool of worker processes.

`parallel_map` and `unordered_map` stop at the first failure; `isolated_map` limits each task's time and
memory, and a task that fails or kills its process costs only its own result.
"""

from __future__ import annotations

import math
import multiprocessing
import os
import resource
import signal
import sys
import time
import traceback
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import islice
from multiprocessing.connection import Connection, wait
from typing import Any, TypeVar

from kinemimic.pipeline.errors import KinemimicError, one_line
from kinemimic.pipeline.parallel.worker import Worker, WorkerDiedError

# A capture of a person takes a second; a file that takes a minute, or gigabytes, is not one.
TIMEOUT = 60.0
MEMORY = 4 * 2**30

Task = TypeVar("Task")
Result = TypeVar("Result")


@dataclass(frozen=True)
class Failure:
    """Takes the place of the result of a task that failed; reason: a description."""

    reason: str


def parallel_map(
    work: Callable[[Task], Result],
    tasks: Sequence[Task],
    *,
    workers: int | None = None,
    progress: Callable[[int], object] | None = None,
) -> list[Result]:
    """Results of all tasks, in their order, from `workers` processes (all cores by default).

    work: a function at a module's top level; its exceptions are raised here. progress: called with the number
    of tasks done since the last call. KinemimicError if a process died. A worker of another pool, which has a
    core of its own, carries out the tasks itself.
    """
    results: dict[int, Result] = {}
    for index, result in unordered_map(work, tasks, workers=workers):
        results[index] = result
        if progress is not None:
            progress(1)
    return [results[index] for index in range(len(tasks))]


def unordered_map(
    work: Callable[[Task], Result], tasks: Sequence[Task], *, workers: int | None = None
) -> Iterator[tuple[int, Result]]:
    """(index, result) of every task, in the order in which they finish; otherwise as `parallel_map`."""
    if multiprocessing.current_process().daemon:
        yield from enumerate(map(work, tasks))
        return
    count = min(workers or len(os.sched_getaffinity(0)), len(tasks))
    for index, outcome in _outcomes(partial(caught, work), tasks, count):
        if isinstance(outcome, WorkerDiedError):
            raise outcome.among(count)
        result, error = outcome
        if error is not None:
            raise error
        yield index, result


def isolated_map(
    work: Callable[[Task], Result],
    tasks: Iterable[Task],
    *,
    workers: int,
    timeout: float = TIMEOUT,
    memory: int = MEMORY,
) -> Iterator[tuple[int, Result | Failure]]:
    """(index, result) of every task, in the order in which they finish.

    work: a function at a module's top level, or a `partial` of one; tasks: taken one by one as workers get
    free; timeout (s), memory (bytes of address space): limits for one task. A task that exceeds them, whose
    process dies, or that raises an exception yields a `Failure`.
    No process is left behind, regardless of how the loop over the results ends.
    """
    function = work.func if isinstance(work, partial) else work
    for index, outcome in _outcomes(
        partial(guarded, work, memory),
        tasks,
        workers,
        setup=partial(_limit, memory),
        preload=function.__module__,  # with all readers that it imports
        timeout=timeout,
    ):
        yield index, Failure(_death(outcome.exitcode)) if isinstance(outcome, WorkerDiedError) else outcome


def _outcomes(
    work: Callable[[Any], Any],
    tasks: Iterable[Any],
    count: int,
    *,
    setup: Callable[[], object] | None = None,
    preload: str | None = None,
    timeout: float = math.inf,
) -> Iterator[tuple[int, Any]]:
    """(index, work(task)) as tasks finish; a WorkerDiedError or Failure (timeout) where there is no result.

    setup: called once in every worker.
    """

    def begun(number: int) -> list[Worker]:
        workers = [Worker(preload=preload) for _ in range(number)]
        for worker in workers:
            worker.begin(_serve, work, setup)
        return workers

    pool = _Pool(begun, timeout)
    waiting = enumerate(tasks)
    try:
        while True:
            pool.hand_out(list(islice(waiting, count - pool.busy)))
            if not pool.busy:
                return
            yield from pool.finished()
    finally:
        pool.end()


class _Pool:
    """Workers, each with its own pipe, so that if one dies or hangs, it is replaced and only its task is
    lost; concurrent.futures would lose all pending tasks.

    begun: starts a number of workers; timeout: s for a task.
    """

    def __init__(self, begun: Callable[[int], list[Worker]], timeout: float) -> None:
        self._begun, self._timeout = begun, timeout
        self._idle: list[Worker] = []
        self._busy: dict[Worker, tuple[int, float]] = {}  # index of the task, deadline

    @property
    def busy(self) -> int:
        """Number of workers with a task."""
        return len(self._busy)

    def hand_out(self, tasks: Sequence[tuple[int, Any]]) -> None:
        """Give each task, with its index, to a worker; those that are left without one end."""
        for worker in self._idle[len(tasks) :]:
            worker.end()
        self._idle = [*self._idle[: len(tasks)], *self._begun(len(tasks) - len(self._idle))]
        for index, task in tasks:
            worker = self._idle.pop()
            self._busy[worker] = (index, time.monotonic() + self._timeout)
            worker.send(task)

    def finished(self) -> Iterator[tuple[int, Any]]:
        """Wait for a worker to finish or to be late; (index, outcome) of all that have by then."""
        first = min(deadline for _, deadline in self._busy.values())
        ready = wait(
            [worker.pipe for worker in self._busy],
            None if math.isinf(first) else max(0.0, first - time.monotonic()),
        )
        for worker, (index, deadline) in tuple(self._busy.items()):
            outcome: Any
            # A worker may have answered since `ready`, while the caller used another's result.
            answered = worker.pipe in ready or worker.pipe.poll()
            if answered:
                outcome = _received(worker)
            elif time.monotonic() > deadline:
                outcome = Failure(f"timed out after {self._timeout:g} s")
            else:
                continue
            del self._busy[worker]
            if answered and not isinstance(outcome, WorkerDiedError):
                self._idle.append(worker)
            else:
                worker.end()
            yield index, outcome

    def end(self) -> None:
        """End all workers."""
        for worker in (*self._idle, *self._busy):
            worker.end()


def _received(worker: Worker) -> Any:
    try:
        return worker.receive()
    except WorkerDiedError as death:
        return death


def _serve(pipe: Connection, work: Callable[[Any], Any], setup: Callable[[], object] | None) -> None:
    """The main loop of a worker: receive tasks and send results until the pipe closes."""
    if setup is not None:
        setup()
    while True:
        pipe.send(work(pipe.recv()))


def caught(work: Callable[[Task], Result], task: Task) -> tuple[Result | None, Exception | None]:
    """The result and no error, or no result and the error with its traceback in a note."""
    try:
        return work(task), None
    except Exception as error:
        error.add_note("".join(traceback.format_exception(error)))
        return None, error


def guarded(work: Callable[[Task], Result], memory: int | None, task: Task) -> Result | Failure:
    """The result, or a Failure: with the reason of an expected error in one line, else it says a bug.

    memory: the limit of the process in bytes, if it has one.
    """
    try:
        return work(task)
    except MemoryError:
        most = "the memory that there is" if memory is None else f"{memory / 2**30:.3g} GiB of memory"
        return Failure(f"it takes more than {most}")
    except (KinemimicError, OSError) as error:
        return Failure(one_line(error))
    except Exception as error:
        return Failure(f"a bug in kinemimic, please report it: {type(error).__name__}: {error}")


def _limit(memory: int) -> None:
    """Limit this process' memory and silence its stderr."""
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    # C libraries that fail on a damaged file write to stderr, into the printed table.
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stderr.fileno())


def _death(code: int | None) -> str:
    if code is not None and code < 0:
        return f"its process was ended by {signal.Signals(-code).name}"
    return f"its process ended with status {code}"
