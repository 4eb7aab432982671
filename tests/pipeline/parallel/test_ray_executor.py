"""Tasks on a Ray cluster: results as in this process, from every node, with limits, and no node missed."""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import partial

import pytest
from peers.node_work import claimed, incapable, slow, squared, troubled
from peers.ray_nodes import RayNodes

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.parallel.executor import InProcess, ordered_map
from kinemimic.pipeline.parallel.node_identity import NodeIdentity
from kinemimic.pipeline.parallel.ray_executor import RayExecutor
from kinemimic.pipeline.parallel.task_pool import Failure


def test_results_are_those_of_this_process(ray_nodes: RayNodes) -> None:
    tasks = [str(k).encode() for k in range(7)]
    assert sorted(RayExecutor().map(squared, iter(tasks))) == sorted(InProcess().map(squared, tasks))


def test_a_task_that_crashes_hangs_or_eats_costs_its_own_result(ray_nodes: RayNodes) -> None:
    tasks = ["one", "crash", "hang", "eat", "two"]
    assert dict(RayExecutor(timeout=3.0, memory=2**32).map(troubled, tasks)) == {
        0: "one",
        1: Failure("its process was ended by SIGSEGV"),
        2: Failure("timed out after 3 s"),
        3: Failure("it takes more than 4 GiB of memory"),
        4: "two",
    }


def test_tasks_are_taken_as_there_is_room(ray_nodes: RayNodes) -> None:
    taken: list[int] = []

    def tasks() -> object:
        for k in range(100):
            taken.append(k)
            yield str(k).encode()

    results = RayExecutor().map(squared, tasks())  # type: ignore[arg-type]
    next(results)
    assert len(taken) <= 2 * 3
    results.close()  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("identity", "message"),
    [
        (claimed, r"node 127\.0\.0\.1: expected numpy 1\.0 as on the driver"),
        (incapable, r"node 127\.0\.0\.1: expected an engine, found none"),
    ],
)
def test_another_kind_of_node_is_refused(
    ray_nodes: RayNodes, identity: Callable[[], NodeIdentity], message: str
) -> None:
    with pytest.raises(KinemimicError, match=message):
        list(RayExecutor(identity=identity).map(squared, [b"1"]))


def test_results_in_order_and_errors_as_they_are(ray_nodes: RayNodes) -> None:
    done: list[int] = []
    executor = RayExecutor(isolated=False)
    found = ordered_map(executor, squared, [b"3", b"1"], progress=done.append)
    assert found == [squared(b"3"), squared(b"1")]
    assert done == [1, 1]
    with pytest.raises(ValueError, match="invalid literal"):
        ordered_map(executor, squared, [b"x"])


@pytest.mark.slow
def test_a_node_killed_within_a_batch_loses_nothing(ray_nodes: RayNodes) -> None:
    """Every node has carried out tasks; those of the killed one are done again by the others."""
    processes = {name: ray_nodes.process(name) for name in ("head", "first", "second")}
    timer = threading.Timer(8.0, ray_nodes.kill, ["second"])
    timer.start()
    found = [result for _, result in RayExecutor().map(partial(slow, 2.0), range(18))]
    timer.join()
    assert sorted(task for task, _ in found) == [*range(18)]  # type: ignore[misc]
    where = [node for _, node in found]  # type: ignore[misc]
    assert set(where) == set(processes.values())
    assert processes["second"] not in where[-6:]
