"""Executors: the same outcomes, whoever carries out the tasks."""

from __future__ import annotations

import pytest

from kinemimic.pipeline.parallel.executor import Executor, InProcess, LocalProcesses
from kinemimic.pipeline.parallel.task_pool import Failure

EXECUTORS: dict[str, Executor] = {
    "in process": InProcess(),
    "one process": LocalProcesses(workers=1, timeout=20.0),
    "three processes": LocalProcesses(workers=3, timeout=20.0),
}


@pytest.mark.parametrize("name", EXECUTORS)
def test_every_task_has_one_outcome(name: str) -> None:
    # A generator: tasks are taken as there is room for them.
    found = [*EXECUTORS[name].map(eval, (task for task in ("1 + 1", "1 / 0", "'a' * 3")))]
    assert sorted(index for index, _ in found) == [0, 1, 2]
    outcomes = dict(found)
    assert (outcomes[0], outcomes[2]) == (2, "aaa")
    assert outcomes[1] == Failure("a bug in kinemimic, please report it: ZeroDivisionError: division by zero")
    assert [*EXECUTORS[name].map(eval, [])] == []


def test_limits_of_a_task_are_those_of_the_executor() -> None:
    executor = LocalProcesses(workers=1, timeout=1.0, memory=2**30)
    found = dict(executor.map(eval, ["__import__('time').sleep(60)", "len(bytearray(3 << 30))", "7"]))
    assert found == {
        0: Failure("timed out after 1 s"),
        1: Failure("it takes more than 1 GiB of memory"),
        2: 7,
    }
