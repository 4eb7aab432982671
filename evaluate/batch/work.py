"""The work of a batch: the captures that wait, the executor that processes them, and the rows that are kept.

Each capture is claimed while this process works on it. One that another batch has claimed is left for the
end, when that batch has usually finished it.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from kinemimic.evaluate.batch.state import BatchState, Kept
from kinemimic.evaluate.batch.task import CaptureTask, Row, resumable, up_to_date
from kinemimic.pipeline.errors import KinemimicError, one_line
from kinemimic.pipeline.parallel.executor import Executor
from kinemimic.pipeline.parallel.task_pool import Failure

_PAUSE = 0.2  # seconds between two looks at what other batches do


class BatchWork:
    """rows: those of the tasks that are finished, by their names; waiting: the other tasks."""

    def __init__(self, tasks: Sequence[CaptureTask], state: BatchState, *, overwrite: bool) -> None:
        self._state, self._overwrite = state, overwrite
        self.rows: dict[str, Row] = {}
        self._claimed: set[str] = set()
        self.waiting: list[CaptureTask] = []
        for task in tasks:
            row = None if overwrite else self._kept(task)
            if row is None:
                self.waiting.append(task)
            else:
                self.rows[task.name] = row
        # The largest first, so that no core waits at the end for one long capture.
        self.waiting.sort(key=lambda task: _size(task.capture), reverse=True)

    def carry_out(self, executor: Executor, advance: Callable[[CaptureTask], object]) -> None:
        """Carry out what is waiting; advance: called for each task that is finished."""
        while self.waiting:
            before = len(self.rows)
            busy: list[CaptureTask] = []
            self._round(executor, busy, advance)
            self.waiting = busy
            if busy and len(self.rows) == before:
                time.sleep(_PAUSE)

    def is_mine(self, task: CaptureTask) -> bool:
        """Whether this process was at work on a task when it was interrupted."""
        return task.name in self._claimed

    def _round(
        self, executor: Executor, busy: list[CaptureTask], advance: Callable[[CaptureTask], object]
    ) -> None:
        drawn: list[CaptureTask] = []
        work, packed = _work(executor)

        def tasks() -> Iterator[Any]:
            for task in self.waiting:
                if not self._state.claim(task.name):
                    busy.append(task)
                    continue
                self._claimed.add(task.name)
                if not self._overwrite and (row := self._kept(task)) is not None:
                    # Another batch has finished it meanwhile.
                    self._finish(task, row, advance)
                else:
                    kept = None if self._overwrite else self._state.get(task.name)
                    resume = kept is not None and executor.shares_disk and resumable(task, kept)
                    try:
                        sent = packed(replace(task, resume=resume))
                    except (KinemimicError, OSError) as error:
                        self._keep(task, _failed(task, one_line(error)), advance)
                        continue
                    drawn.append(task)
                    yield sent

        for index, outcome in executor.map(work, tasks()):
            self._keep(drawn[index], self._outcome(executor, drawn[index], outcome), advance)

    def _outcome(self, executor: Executor, task: CaptureTask, outcome: Any) -> Kept:
        from kinemimic.evaluate.batch.capture import clear_if_free  # noqa: PLC0415 (import cost)
        from kinemimic.evaluate.batch.packed_capture import unpack  # noqa: PLC0415 (import cost)

        if isinstance(outcome, Failure):
            clear_if_free(task.folder)
            return _failed(task, outcome.reason)
        if executor.shares_disk:
            assert isinstance(outcome, Kept)  # noqa: S101 (narrows the type)
            return outcome
        try:
            return unpack(task, outcome)
        except (KinemimicError, OSError) as error:
            return _failed(task, one_line(error))

    def _keep(self, task: CaptureTask, kept: Kept, advance: Callable[[CaptureTask], object]) -> None:
        self._state.put(task.name, kept)
        self._finish(task, kept.row, advance)

    def _finish(self, task: CaptureTask, row: Row, advance: Callable[[CaptureTask], object]) -> None:
        self._state.release(task.name)
        self._claimed.discard(task.name)
        self.rows[task.name] = row
        advance(task)

    def _kept(self, task: CaptureTask) -> Row | None:
        """The row of an earlier batch, if it is up to date."""
        kept = self._state.get(task.name)
        made = None if kept is None else up_to_date(task, kept)
        if kept is None or made is None:
            return None
        row = kept.row | {"file": str(task.capture), "folder": str(task.folder)}
        if made != kept.made_from or row != kept.row:
            self._state.put(task.name, Kept(row, made))
        return row


def _work(executor: Executor) -> tuple[Callable[[Any], Any], Callable[[CaptureTask], Any]]:
    """What the executor calls, and what makes its argument from a task."""
    # Import cost: these load the stages.
    from kinemimic.evaluate.batch.capture import process  # noqa: PLC0415
    from kinemimic.evaluate.batch.packed_capture import pack, process_packed  # noqa: PLC0415

    return (process, lambda task: task) if executor.shares_disk else (process_packed, pack)


def _size(capture: Path) -> int:
    """Bytes of a file, or of the files in a folder; 0 if it cannot be read, which its own stages report."""
    try:
        files = [*capture.iterdir()] if capture.is_dir() else [capture]
        return sum(file.stat().st_size for file in files)
    except OSError:
        return 0


def _failed(task: CaptureTask, reason: str) -> Kept:
    """The row of a capture whose process crashed or took too much; the next batch tries it again."""
    from kinemimic.evaluate.batch.row import FAILED, empty_row  # noqa: PLC0415 (import cost)

    return Kept(empty_row(task, FAILED, reason), {})
