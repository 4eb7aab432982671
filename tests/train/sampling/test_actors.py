"""Ray actors sample what processes of this machine sample, to the last bit, also when nodes are lost."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from peers.constant import constant
from peers.inline_workers import InlinePool
from peers.ray_nodes import RayNodes, kill_actor, node_of

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.parallel.node_identity import NodeIdentity
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.env_config import DomainRandomization, EnvConfig
from kinemimic.train.sampling.pool import OpenPool, SamplerPool
from kinemimic.train.sampling.processes import SamplerProcesses
from kinemimic.train.sampling.simulators import simulators
from kinemimic.train.sampling.workers import Workers
from kinemimic.train.task.env import ACTIONS

Arrays = dict[str, NDArray[Any]]
NOISE = np.full(ACTIONS, 0.3, dtype=np.float32)
# Episodes end, begin elsewhere and are pushed within a round: all state of the environments counts.
HARD = replace(
    EnvConfig(), episode=7, domain_randomization=DomainRandomization(push=(50.0, 200.0), rest=(0.1, 0.2))
)
COUNT, ENVS = 2, 5


def rounds(
    motion: Motion,
    open_pool: OpenPool,
    *,
    steps: int = 10,
    between: Callable[[int, SamplerPool], object] = lambda number, pool: None,
) -> list[Arrays]:
    """The samples of three rounds and what follows them; between: called before each round."""
    found: list[Arrays] = []
    with Workers(motion, HARD, ENVS, 3, COUNT, "native", open_pool) as workers:
        for number in range(3):
            between(number, workers._pool)
            samples = workers.sample(constant(), NOISE, HARD.reward, 1.0, steps)
            found.append({f.name: np.asarray(getattr(samples, f.name)) for f in fields(samples)})
            found.append(dict(workers.env_states()))
        found.append({"returns": np.array(workers.robust_returns(constant(), HARD.reward))})
    return found


def assert_same(one: list[Arrays], other: list[Arrays]) -> None:
    for a, b in zip(one, other, strict=True):
        assert a.keys() == b.keys()
        for name, array in a.items():
            np.testing.assert_array_equal(array, b[name], err_msg=name)


@pytest.fixture(autouse=True)
def native() -> None:
    pytest.importorskip("kinemimic_native", reason="the native engine is not built here")


def test_actors_sample_what_processes_sample(motion: Motion, ray_nodes: RayNodes) -> None:
    with simulators(ray_nodes.cluster.address) as where:
        assert (where.cores, where.shares_disk) == (3, False)
        assert where.count(None, 2) == 2
        with pytest.raises(KinemimicError, match=r"--workers 4: expected at most 3, the cores"):
            where.count(4, 64)

        def kill_one(number: int, pool: Any) -> None:
            """An actor that dies between rounds is replaced without a trace."""
            if number == 1:
                kill_actor(pool._seats[1].actor)

        actors = rounds(motion, where.open_pool, between=kill_one)
    assert_same(actors, rounds(motion, InlinePool))


@pytest.mark.slow
@pytest.mark.parametrize("moment", [0, 2])
def test_a_node_killed_within_a_round_changes_nothing(
    motion: Motion, ray_nodes: RayNodes, moment: int
) -> None:
    """The round takes more than a second; a node with an actor is killed in its middle."""
    killed: list[str] = []

    def kill_soon(number: int, pool: Any) -> None:
        if number == moment:
            there = [node_of(seat.actor) for seat in pool._seats]
            names = [name for name, node in ray_nodes.nodes.items() if node.node_id in there]
            killed.append(names[-1])
            threading.Timer(0.5, ray_nodes.kill, names[-1:]).start()
            pools.append(pool)

    pools: list[Any] = []
    with simulators(ray_nodes.cluster.address) as where:
        actors = rounds(motion, where.open_pool, steps=1500, between=kill_soon)
    assert killed
    assert killed[0] not in ray_nodes.nodes
    assert pools[0].replaced >= 1
    assert_same(actors, rounds(motion, SamplerProcesses, steps=1500))


def test_an_actor_on_another_kind_of_node_is_refused(
    motion: Motion, ray_nodes: RayNodes, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The driver claims to be another machine; the actors, in their own processes, tell the truth."""
    from kinemimic.train.sampling import actors  # noqa: PLC0415 (imports Ray)

    other = NodeIdentity.here({"kinemimic-native": "9.9"})
    monkeypatch.setattr(actors, "engine_identity", lambda engine: other)
    with (
        simulators(ray_nodes.cluster.address) as where,
        pytest.raises(KinemimicError, match=r"node 127\.0\.0\.1: expected kinemimic-native 9\.9"),
    ):
        Workers(motion, HARD, ENVS, 3, COUNT, "native", where.open_pool)
