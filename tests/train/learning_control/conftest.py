from __future__ import annotations

from collections.abc import Iterator

import pytest

from kinemimic.evaluate.policies.recipe import POLICIES
from kinemimic.retarget.formats.motion_json import read_motion_json
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.reference.reference import Reference
from kinemimic.train.rollout.policy import POLICY, Policy
from kinemimic.train.sim.engines import open_world
from kinemimic.train.task.env import ImitationBatch


@pytest.fixture(scope="session")
def tracker() -> tuple[Policy, TrainConfig]:
    policy, record = Policy.load(POLICIES / "tracker" / POLICY)
    return policy, TrainConfig.from_json(record["config"])


@pytest.fixture
def batch(tracker: tuple[Policy, TrainConfig]) -> Iterator[ImitationBatch]:
    """Four humanoids on the walk that ships."""
    reference = Reference(read_motion_json(POLICIES / "walk" / "motion.json"))
    found = ImitationBatch(open_world(4, "pybullet"), reference, tracker[1].measured_env)
    yield found
    found.world.close()
