"""Tasks over worker processes: results in order; the first failure raised, or one result per failure."""

from __future__ import annotations

import errno
import math
import multiprocessing
import os
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import ClassVar

import pytest

from kinemimic.pipeline.errors import CaptureError, KinemimicError
from kinemimic.pipeline.parallel import task_pool
from kinemimic.pipeline.parallel.task_pool import Failure, guarded, isolated_map, parallel_map, unordered_map
from kinemimic.pipeline.readers.recognise import read


def test_results_come_in_the_order_of_the_tasks() -> None:
    done: list[int] = []
    assert parallel_map(math.factorial, [6, 1, 4, 3], workers=2, progress=done.append) == [720, 1, 24, 6]
    assert done == [1, 1, 1, 1]
    assert parallel_map(math.factorial, []) == []
    with pytest.raises(ValueError, match="negative") as error:
        parallel_map(math.factorial, [2, -1], workers=1)
    assert "in caught" in error.value.__notes__[0]
    assert not multiprocessing.active_children()


def test_results_come_as_they_are_ready_and_a_loop_that_stops_leaves_no_process() -> None:
    naps = [0.6, 0.0]
    assert [index for index, _ in unordered_map(time.sleep, naps, workers=2)] == [1, 0]
    results = unordered_map(time.sleep, [0.0, 60.0], workers=2)
    assert next(results) == (0, None)
    results.close()
    assert not multiprocessing.active_children()


def test_a_worker_that_dies_is_one_line() -> None:
    with pytest.raises(KinemimicError, match="expected 1 worker processes, found that one ended, status 9;"):
        parallel_map(os._exit, [9], workers=2)


def test_isolated_results_do_not_depend_on_the_number_of_workers() -> None:
    sums = [f"{k} + 1" for k in range(7)]
    for workers in (1, 3):
        assert dict(isolated_map(eval, sums, workers=workers)) == {k: k + 1 for k in range(7)}


def test_a_death_costs_one_isolated_task() -> None:
    tasks = [
        "1",
        "__import__('os')._exit(9)",
        "__import__('os').abort()",
        "2",
        "1/0",
        "bytearray(8 << 30)",
        "3",
    ]
    found = dict(isolated_map(eval, tasks, workers=2))
    assert [found[k] for k in (0, 3, 6)] == [1, 2, 3]
    reasons = {k: result.reason for k, result in found.items() if isinstance(result, Failure)}
    assert reasons[1] == "its process ended with status 9"
    assert reasons[2] == "its process was ended by SIGABRT"
    assert reasons[4] == "a bug in kinemimic, please report it: ZeroDivisionError: division by zero"
    assert reasons[5] == "it takes more than 4 GiB of memory"


def test_an_expected_error_of_a_task_is_its_reason_and_no_bug() -> None:
    def failing(error: Exception) -> None:
        raise error

    assert guarded(failing, None, KinemimicError("expected X,\nfound Y")) == Failure("expected X, found Y")
    full = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "out/a")
    assert guarded(failing, None, full) == Failure("out/a: no space left on device")
    assert "a bug in kinemimic" in guarded(failing, None, ValueError("x")).reason


def test_an_isolated_task_that_hangs_is_given_up() -> None:
    begin = time.monotonic()
    found = dict(isolated_map(eval, ["__import__('time').sleep(60)", "1"], workers=1, timeout=1.0))
    assert found == {0: Failure("timed out after 1 s"), 1: 1}
    assert time.monotonic() - begin < 20


def test_a_loop_that_stops_early_leaves_no_process_behind() -> None:
    pids = ["__import__('os').getpid()", "__import__('time').sleep(60)"]
    results = isolated_map(eval, pids, workers=2)
    _, pid = next(results)
    results.close()
    with pytest.raises(ProcessLookupError):
        for _ in range(100):
            os.kill(pid, 0)
            time.sleep(0.05)


def test_tasks_are_taken_as_workers_get_free() -> None:
    taken: list[int] = []

    def tasks() -> Iterator[str]:
        for k in range(5):
            taken.append(k)
            yield str(k)

    results = isolated_map(eval, tasks(), workers=2)
    next(results)
    assert len(taken) <= 4  # two at first, and one for each result that has come
    assert len([*results]) == 4
    assert taken == [*range(5)]
    assert not multiprocessing.active_children()


def test_an_error_of_a_capture_comes_out_of_a_worker_as_it_is(tmp_path: Path) -> None:
    (tmp_path / "empty.bvh").write_text("")
    with pytest.raises(CaptureError, match=r"empty\.bvh: expected"):
        parallel_map(read, [tmp_path / "empty.bvh"], workers=1)


class Answers:
    """Takes the place of a worker; the test answers."""

    of: ClassVar[dict[str, Answers]] = {}

    def __init__(self, **_: object) -> None:
        self.pipe, self.answers = multiprocessing.Pipe()

    def begin(self, *_: object) -> None:
        """Nothing runs."""

    def send(self, task: str) -> None:
        self.of[task] = self
        if task == "quick":
            self.answers.send("first")

    def receive(self) -> object:
        return self.pipe.recv()

    def end(self) -> None:
        self.pipe.close()


def test_a_result_that_came_while_the_caller_was_busy_is_no_timeout(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    monkeypatch.setattr(task_pool, "Worker", Answers)
    monkeypatch.setattr(task_pool, "time", SimpleNamespace(monotonic=lambda: now[0]))
    outcomes = isolated_map(str, ["quick", "slower"], workers=2, timeout=20.0)
    assert next(outcomes) == (0, "first")
    Answers.of["slower"].answers.send("second")
    now[0] = 30.0
    assert next(outcomes) == (1, "second")


def test_a_result_that_has_not_come_when_the_time_is_over_is_a_timeout(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now = [0.0]
    monkeypatch.setattr(task_pool, "Worker", Answers)
    monkeypatch.setattr(task_pool, "time", SimpleNamespace(monotonic=lambda: now[0]))
    outcomes = isolated_map(str, ["quick", "slower"], workers=2, timeout=20.0)
    assert next(outcomes) == (0, "first")
    now[0] = 30.0
    assert next(outcomes) == (1, Failure("timed out after 20 s"))
