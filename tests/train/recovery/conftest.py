from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace

import pytest

from kinemimic.evaluate.policies.recipe import POLICIES
from kinemimic.retarget.formats.motion_json import read_motion_json
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.recovery import Recovery
from kinemimic.train.reference.reference import Reference
from kinemimic.train.rollout.policy import POLICY, Policy
from kinemimic.train.sim.engines import open_world, resolve
from kinemimic.train.task.env import ImitationBatch

# A search and lessons of seconds.
SMALL = Recovery(
    phases=2, directions=(180.0,), forces=(200.0, 240.0), candidates=6, elite=2, iterations=2, taught=0.0,
    rounds=1, humanoids=12,
)  # fmt: skip


@pytest.fixture(scope="session")
def walk() -> Motion:
    return read_motion_json(POLICIES / "walk" / "motion.json")


@pytest.fixture(scope="session")
def trained() -> tuple[Policy, TrainConfig]:
    """The walk that ships, with settings for a small search."""
    policy, record = Policy.load(POLICIES / "walk" / POLICY)
    return policy, replace(TrainConfig.from_json(record["config"]), recovery=SMALL)


@pytest.fixture
def humanoids(walk: Motion, trained: tuple[Policy, TrainConfig]) -> Iterator[Callable[[int], ImitationBatch]]:
    """Opens batches of humanoids on the walk."""
    with ExitStack() as opened:

        def of(count: int) -> ImitationBatch:
            world = open_world(count, resolve("auto"))
            opened.callback(world.close)
            return ImitationBatch(world, Reference(walk), trained[1].measured_env)

        yield of
