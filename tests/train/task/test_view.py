"""A policy sees in a batch of another task what it would see in its own."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from kinemimic.pipeline.files.data_folder import DATASETS
from kinemimic.retarget.formats.motion_json import read_motion_json
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.env_config import EnvConfig
from kinemimic.train.config.tracker import tracker_config
from kinemimic.train.reference.reference import Reference
from kinemimic.train.sim.engines import open_world
from kinemimic.train.task.env import ACTIONS, ImitationBatch
from kinemimic.train.task.view import View

COUNT = 8
TRACKER, PHASED = tracker_config().env, EnvConfig(preview=(1, 5))


@pytest.fixture(scope="module")
def walk() -> Motion:
    """A walk whose halves are mirror images, so that both tasks mirror it."""
    return read_motion_json(DATASETS / "policies/walk/motion.json")


@pytest.fixture
def batches(walk: Motion) -> Iterator[tuple[ImitationBatch, ImitationBatch]]:
    """Humanoids all around a cycle in either task, in the same states."""
    worlds = [open_world(COUNT, "auto") for _ in range(2)]
    pair = [
        ImitationBatch(world, Reference(walk), config)
        for world, config in zip(worlds, (TRACKER, PHASED), strict=True)
    ]
    for batch in pair:
        batch.reset(np.arange(COUNT), (np.arange(COUNT) + 0.5) / COUNT)
    yield pair[0], pair[1]
    for world in worlds:
        world.close()


def test_its_observations_and_actions_are_those_of_its_own_task(
    batches: tuple[ImitationBatch, ImitationBatch],
) -> None:
    tracker, own = batches
    view = View(tracker, replace(PHASED, max_drift=9.0))
    random = np.random.default_rng(3)
    for _ in range(6):
        np.testing.assert_allclose(view.observe(), own.observe(), atol=1e-9)
        actions = random.normal(0.0, 0.1, (COUNT, ACTIONS))
        tracker.step(view.translated(actions))
        own.step(actions)
        np.testing.assert_allclose(tracker.bodies.positions, own.bodies.positions, atol=1e-9)


def test_only_a_task_whose_actions_mean_the_same_is_seen(
    batches: tuple[ImitationBatch, ImitationBatch],
) -> None:
    for other in (replace(PHASED, torque_feedforward=False), replace(PHASED, observed_obstacles=2)):
        with pytest.raises(ValueError, match="expected a task of the same actions"):
            View(batches[0], other)
