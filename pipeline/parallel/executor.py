"""Executors: where tasks run, in this process, in others on this machine, or on a cluster.

Code that takes an `Executor` does not depend on which it is. If the executor shares no disk with its caller
(`shares_disk`), a task carries the bytes of its inputs, and its result those of its outputs. Otherwise both
carry paths, because copying the files of every task through pipes would gain nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol, TypeVar

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.parallel.task_pool import MEMORY, TIMEOUT, Failure, caught, guarded, isolated_map

Task = TypeVar("Task")
Result = TypeVar("Result")


class Executor(Protocol):
    """Calls a function on tasks that do not depend on each other."""

    @property
    def shares_disk(self) -> bool:
        """Whether tasks find the files of the caller, at the same paths, and the caller finds theirs."""
        ...

    def map(
        self, work: Callable[[Task], Result], tasks: Iterable[Task]
    ) -> Iterator[tuple[int, Result | Failure]]:
        """(index, result) of every task, in the order in which they finish; index counts from 0.

        work: a function at a module's top level, or a `partial` of one; a call of it may be repeated, so it
        has to leave the same behind when it is called again. tasks: taken from the iterable as there is room
        for them, since they may carry the content of files. Tasks and results can be pickled. A task that
        raises, kills its process or exceeds a limit of the executor yields a `Failure` in place of a result.
        Nothing is left running, regardless of how the loop over the results ends.
        """
        ...


@dataclass(frozen=True)
class InProcess:
    """In the process of the caller, one task after the other, without limits of time and memory.

    A task that kills its process kills the caller.
    """

    shares_disk: bool = True

    def map(
        self, work: Callable[[Task], Result], tasks: Iterable[Task]
    ) -> Iterator[tuple[int, Result | Failure]]:
        """As `Executor.map`."""
        for index, task in enumerate(tasks):
            yield index, guarded(work, None, task)


@dataclass(frozen=True)
class LocalProcesses:
    """`workers` processes of this machine; timeout (s), memory (bytes of address space): limits of a task."""

    workers: int
    timeout: float = TIMEOUT
    memory: int = MEMORY
    shares_disk: bool = True

    def map(
        self, work: Callable[[Task], Result], tasks: Iterable[Task]
    ) -> Iterator[tuple[int, Result | Failure]]:
        """As `Executor.map`."""
        return isolated_map(work, tasks, workers=self.workers, timeout=self.timeout, memory=self.memory)


def ordered_map(
    executor: Executor,
    work: Callable[[Task], Result],
    tasks: Iterable[Task],
    *,
    progress: Callable[[int], object] | None = None,
) -> list[Result]:
    """Results of all tasks, in their order; as `parallel_map`, whose exceptions it also raises.

    progress: called with the number of tasks done since the last call. KinemimicError for a task without a
    result.
    """
    results: dict[int, Result] = {}
    for index, result in unordered_results(executor, work, tasks):
        results[index] = result
        if progress is not None:
            progress(1)
    return [results[index] for index in range(len(results))]


def unordered_results(
    executor: Executor, work: Callable[[Task], Result], tasks: Iterable[Task]
) -> Iterator[tuple[int, Result]]:
    """(index, result) of every task, in the order in which they finish; otherwise as `ordered_map`."""
    outcome: Any
    for index, outcome in executor.map(partial(caught, work), tasks):
        if isinstance(outcome, Failure):
            raise KinemimicError(f"expected a result of every task, found none of one: {outcome.reason}")
        result, error = outcome
        if error is not None:
            raise error
        yield index, result
