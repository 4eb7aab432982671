"""The simulated schedule: its laws, and times that raylets of this machine take."""

from __future__ import annotations

import time
from functools import partial

import pytest
from bench.cluster_schedule import RoundCosts, TaskCosts, makespan, training_round
from peers.node_work import slow
from peers.ray_nodes import RayNodes

from kinemimic.pipeline.parallel.ray_executor import RayExecutor

TASK = TaskCosts(compute=1.0, dispatch=0.001, sent=1e6, returned=1e6, bandwidth=1e9)
ROUND = RoundCosts(
    samples=4096, environments=64, sample=3e-4, update=0.5, weights=1e6, sample_bytes=1e3, call=1e-3
)


def test_cores_share_tasks_until_the_driver_is_the_limit() -> None:
    costs = TaskCosts(compute=1.0, dispatch=0.0)
    assert [makespan(12, cores, costs) for cores in (1, 2, 4, 5, 12, 100)] == [12.0, 6.0, 3.0, 3.0, 1.0, 1.0]
    # A driver that needs 2 ms for each task feeds 500 cores.
    times = [makespan(10_000, cores, TASK) for cores in (100, 500, 5000)]
    assert times[0] == pytest.approx(100.0, rel=0.02)
    assert times[1] == pytest.approx(20.0, rel=0.1)
    assert times[2] == pytest.approx(10_000 * 0.002, rel=0.1)


def test_a_round_cannot_be_faster_than_its_learner_and_its_slowest_actor() -> None:
    alone, two, many = (training_round(nodes, 1, ROUND) for nodes in (1, 2, 1000))
    assert alone.rollout == pytest.approx(4096 * 3e-4)
    assert two.rollout == pytest.approx(alone.rollout / 2)
    assert many.rollout == pytest.approx(alone.rollout / 64)  # one environment for each of 64 actors
    assert many.seconds > ROUND.update + many.rollout
    assert training_round(3, 1, ROUND).rollout == pytest.approx(alone.rollout * 22 / 64)


@pytest.mark.slow
@pytest.mark.parametrize("nodes", [1, 2, 4])
def test_raylets_take_the_time_that_is_simulated(running_ray: RayNodes, nodes: int) -> None:
    """Tasks that wait and do not compute, so that nodes on one machine do not take each other's cores.

    Within 30 %: a child process starts for each task, on a machine that may do other work. The first tasks,
    which start Ray's processes, are not measured.
    """
    running_ray.resized(nodes)
    work = partial(slow, 2.0)
    list(RayExecutor().map(work, range(2 * nodes)))
    began = time.monotonic()
    list(RayExecutor().map(work, range(4 * nodes)))
    taken = time.monotonic() - began
    assert taken == pytest.approx(makespan(4 * nodes, nodes, TaskCosts(compute=2.0, dispatch=0.002)), rel=0.3)
