from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest

from kinemimic.evaluate.policies.recipe import POLICIES
from kinemimic.retarget.formats.motion_json import read_motion_json
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.reference.reference import Reference
from kinemimic.train.rollout.policy import POLICY, Policy
from kinemimic.train.sim.engines import open_world, resolve
from kinemimic.train.task.env import ImitationBatch


@pytest.fixture(scope="session")
def tracker() -> tuple[Policy, TrainConfig]:
    policy, record = Policy.load(POLICIES / "tracker" / POLICY)
    return policy, TrainConfig.from_json(record["config"])


@pytest.fixture
def humanoids(tracker: tuple[Policy, TrainConfig]) -> Iterator[Callable[[int], ImitationBatch]]:
    """Opens batches of humanoids on the walk that ships."""
    reference = Reference(read_motion_json(POLICIES / "walk" / "motion.json"))
    with ExitStack() as opened:

        def of(count: int) -> ImitationBatch:
            world = open_world(count, resolve("auto"))
            opened.callback(world.close)
            return ImitationBatch(world, reference, tracker[1].measured_env)

        yield of


@pytest.fixture
def batch(humanoids: Callable[[int], ImitationBatch]) -> ImitationBatch:
    """Four humanoids."""
    return humanoids(4)
