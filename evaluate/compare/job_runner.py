"""Run tasks in parallel, each in a process that may start further processes, as training does."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from multiprocessing.connection import Connection, wait
from typing import Any, Protocol, TypeVar

from kinemimic.pipeline.cli.progress import reported_to
from kinemimic.pipeline.cli.progress_state import ProgressState
from kinemimic.pipeline.errors import KinemimicError, one_line
from kinemimic.pipeline.parallel.interruption import deferred
from kinemimic.pipeline.parallel.worker import Worker, WorkerDiedError

Task = TypeVar("Task")
Heard_contra = TypeVar("Heard_contra", contravariant=True)
_LOOK = 0.5  # s between checks for Ctrl-C


class Listener(Protocol[Heard_contra]):
    """Receives the progress and results of the tasks."""

    def begun(self, task: Heard_contra) -> None:
        """The task's process has started."""

    def advanced(self, task: Heard_contra, state: ProgressState) -> None:
        """The task, or a part of it, has come so far."""

    def ended(self, task: Heard_contra, error: str | None) -> None:
        """The task has finished; error: in one line, None if it succeeded."""


def side_by_side(
    work: Callable[[Task], object], tasks: Sequence[Task], jobs: int, listener: Listener[Task]
) -> None:
    """Run all tasks, at most `jobs` at a time; a task that fails does not affect the others.

    work: a function at a module's top level. After Ctrl-C or
    SIGTERM, no further task starts, and the running processes get SIGTERM and are waited for, so that a
    training can save its checkpoint; then KeyboardInterrupt is raised. A second signal ends them at once.
    """
    left = deque(tasks)
    running: dict[Worker, Task] = {}
    asked = False
    with deferred() as interruption:
        try:
            while running or (left and not asked):
                if interruption.asked and not asked:
                    asked = True
                    left.clear()
                    for worker in running:
                        worker.terminate()
                while left and len(running) < jobs:
                    worker, task = Worker(daemon=False), left.popleft()
                    worker.begin(_do, work, task)
                    running[worker] = task
                    listener.begun(task)
                ready = wait([worker.pipe for worker in running], _LOOK)
                for worker, task in tuple(running.items()):
                    if worker.pipe not in ready:
                        continue
                    kind, content = _message(worker)
                    if kind == "progress":
                        listener.advanced(task, content)
                        continue
                    del running[worker]
                    worker.end(patience=None)
                    if not asked:
                        listener.ended(task, content)
        finally:
            for worker in running:
                worker.end()
    if asked:
        raise KeyboardInterrupt


def _message(worker: Worker) -> tuple[str, Any]:
    """("progress", its state) or, as the last message, ("ended", an error in one line or None)."""
    try:
        message: tuple[str, Any] = worker.receive()
    except WorkerDiedError as death:
        advice = "; memory may be short: use fewer --jobs" if death.exitcode == -9 else ""
        return "ended", f"its process ended, status {death.exitcode}{advice}"
    return message


def _do(connection: Connection, work: Callable[[Task], object], task: Task) -> None:
    error = None
    try:
        with reported_to(lambda state: connection.send(("progress", state))):
            work(task)
    except (KinemimicError, OSError) as found:
        error = one_line(found)
    except KeyboardInterrupt:  # the task was asked to end, and has saved its state
        return
    connection.send(("ended", error))
