"""No item can harm another: whatever happens to its process, the others have their results."""

from __future__ import annotations

import os
import time

import pytest

from kinemimic.pipeline.parallel.isolated_pool import Failed, each


def test_each_item_has_its_result_whatever_the_number_of_processes() -> None:
    sums = [f"{k} + 1" for k in range(7)]
    for jobs in (1, 3):
        assert dict(each(eval, sums, jobs=jobs)) == {k: k + 1 for k in range(7)}


def test_a_death_costs_one_item() -> None:
    items = [
        "1",
        "__import__('os')._exit(9)",
        "__import__('os').abort()",
        "2",
        "1/0",
        "bytearray(8 << 30)",
        "3",
    ]
    found = dict(each(eval, items, jobs=2))
    assert [found[k] for k in (0, 3, 6)] == [1, 2, 3]
    reasons = {k: result.reason for k, result in found.items() if isinstance(result, Failed)}
    assert reasons[1] == "its process ended with status 9"
    assert reasons[2] == "its process was ended by SIGABRT"
    assert "ZeroDivisionError" in reasons[4]
    assert "memory" in reasons[5]


def test_one_that_hangs_is_given_up() -> None:
    begin = time.monotonic()
    found = dict(each(eval, ["__import__('time').sleep(60)", "1"], jobs=1, seconds=1.0))
    assert found == {0: Failed("given up after 1 s"), 1: 1}
    assert time.monotonic() - begin < 20


def test_who_stops_listening_leaves_no_process_behind() -> None:
    pids = ["__import__('os').getpid()", "__import__('time').sleep(60)"]
    results = each(eval, pids, jobs=2)
    _, pid = next(results)
    results.close()
    with pytest.raises(ProcessLookupError):
        for _ in range(100):
            os.kill(pid, 0)
            time.sleep(0.05)
