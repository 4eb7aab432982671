"""Pushes of humanoids that walk."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from kinemimic.train.config.config import TrainConfig
from kinemimic.train.recovery.pushes import PELVIS, PUSH, SETTLE, Pushes, pushed, survived, walk_to
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.task.env import ImitationBatch

Humanoids = Callable[[int], ImitationBatch]
Trained = tuple[Policy, TrainConfig]


def test_angles_count_from_the_heading_counterclockwise() -> None:
    pushes = Pushes(np.zeros(3), np.array([10.0, 20.0, 0.0]), np.radians([0.0, 90.0, 180.0]))
    found = pushes.wrenches(0.5 * np.pi)  # of somebody who walks along y
    np.testing.assert_allclose(found[:, PELVIS, :2], [(0.0, 10.0), (-20.0, 0.0), (0.0, 0.0)], atol=1e-12)
    found[:, PELVIS, :2] = 0.0
    assert not found.any()


def test_a_push_begins_at_its_phase(humanoids: Humanoids, trained: Trained) -> None:
    batch, phases = humanoids(2), np.array([0.1, 0.7])
    walk_to(batch, trained[0], phases)
    np.testing.assert_allclose(batch.phases, phases, atol=1e-9)
    np.testing.assert_array_equal(batch.ages, SETTLE)


def test_the_impulse_is_that_of_the_force(humanoids: Humanoids, trained: Trained) -> None:
    """Against a humanoid that is not pushed, momentum grows by force times time, but for what the feet do."""
    batch = humanoids(2)
    walk_to(batch, trained[0], np.full(2, 0.3))
    pushes = Pushes(np.full(2, 0.3), np.array([0.0, 60.0]), np.full(2, 0.5 * np.pi))
    act = lambda _, seen: trained[0].act(seen).astype(np.float64)  # noqa: E731
    for _ in pushed(batch, pushes, 1, act):
        pass
    aside = batch.bodies.linear[1, PELVIS, 1] - batch.bodies.linear[0, PELVIS, 1]
    # 60 N for 1/30 s: 2 N s, on 45 to 50 kg at least 0.04 m/s, more on the pelvis, which is hit first.
    assert 0.03 < aside < 0.5


def test_who_is_thrown_over_has_not_survived(humanoids: Humanoids, trained: Trained) -> None:
    batch = humanoids(3)
    pushes = Pushes(np.array([0.1, 0.1, 0.6]), np.array([0.0, 2000.0, 40.0]), np.full(3, np.pi))
    np.testing.assert_array_equal(survived(batch, trained[0], pushes), [True, False, True])


@pytest.mark.parametrize("steps", [PUSH + 3])
def test_it_ends_when_nobody_is_upright(steps: int, humanoids: Humanoids, trained: Trained) -> None:
    batch = humanoids(1)
    walk_to(batch, trained[0], np.zeros(1))
    pushes = Pushes(np.zeros(1), np.array([3000.0]), np.zeros(1))
    act = lambda _, seen: trained[0].act(seen).astype(np.float64)  # noqa: E731
    assert sum(1 for _ in pushed(batch, pushes, 10 * steps, act)) < 10 * steps
