"""Tasks side by side, each in a process that may start processes of its own, as a training does."""

from __future__ import annotations

import multiprocessing
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any, Generic, NamedTuple, Protocol, TypeVar

from kinemimic.pipeline.cli.progress import overheard
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.parallel.interruption import deferred
from kinemimic.pipeline.parallel.process_pool import end_with_parent, inherited

Task = TypeVar("Task")
Heard_contra = TypeVar("Heard_contra", contravariant=True)
_LOOK = 0.5  # s between two looks whether Ctrl-C was pressed


class Listener(Protocol[Heard_contra]):
    """Who is told what becomes of the tasks."""

    def begun(self, task: Heard_contra) -> None:
        """Its process is started."""

    def advanced(
        self, task: Heard_contra, description: str, done: float, fields: Mapping[str, object]
    ) -> None:
        """A bar of the task, so described, stands at so many units, with numbers beside it."""

    def ended(self, task: Heard_contra, error: str | None) -> None:
        """It is done, or an error in one line."""


class _Running(NamedTuple, Generic[Task]):
    task: Task
    process: BaseProcess
    verdict: list[str | None]  # empty until it has said how it ended


def side_by_side(
    work: Callable[[Task], object], tasks: Sequence[Task], jobs: int, listener: Listener[Task]
) -> None:
    """Do all tasks, at most `jobs` at a time; what fails does not keep the others.

    work: a function of a module's top level. Ctrl-C or SIGTERM: nothing else begins, the processes are asked
    to end by SIGTERM and waited for, so that a training saves its checkpoint; then KeyboardInterrupt. A
    second one ends them at once.
    """
    context = multiprocessing.get_context("spawn")
    left = deque(tasks)
    running: dict[Connection, _Running[Task]] = {}
    asked = False
    with deferred() as interruption:
        try:
            while running or (left and not asked):
                if interruption.asked and not asked:
                    asked = True
                    left.clear()
                    for one in running.values():
                        one.process.terminate()
                while left and len(running) < jobs:
                    ours, theirs = context.Pipe(duplex=False)
                    task = left.popleft()
                    process = context.Process(target=_do, args=(work, task, theirs))
                    # It ignores Ctrl-C, which reaches the whole group, and heeds the SIGTERM from here.
                    with inherited():
                        process.start()
                    theirs.close()
                    running[ours] = _Running(task, process, [])
                    listener.begun(task)
                for connection in wait(list(running), _LOOK):
                    assert isinstance(connection, Connection)  # noqa: S101 (for mypy: wait takes others too)
                    one = running[connection]
                    try:
                        _hear(one, connection.recv(), listener)
                    except EOFError:
                        del running[connection]
                        one.process.join()
                        if not asked:
                            listener.ended(one.task, _verdict(one))
        finally:
            for one in running.values():
                one.process.kill()
    if asked:
        raise KeyboardInterrupt


def _hear(one: _Running[Task], said: tuple[str, Any], listener: Listener[Task]) -> None:
    kind, content = said
    if kind == "ended":
        one.verdict.append(content)
    else:
        listener.advanced(one.task, *content)


def _verdict(one: _Running[Any]) -> str | None:
    if one.verdict:
        return one.verdict[0]
    status = one.process.exitcode
    return f"its process ended, status {status}" + (
        "; memory may be short: take fewer --jobs" if status == -9 else ""
    )


def _do(work: Callable[[Task], object], task: Task, connection: Connection) -> None:
    end_with_parent()
    error = None
    try:
        with overheard(lambda *bar: connection.send(("bar", bar))):
            work(task)
    except KinemimicError as found:
        error = str(found)
    except OSError as found:
        error = f"{found.filename or 'a file'}: {found.strerror or found}"
    except KeyboardInterrupt:  # it was asked to end, and saved
        return
    connection.send(("ended", error))
