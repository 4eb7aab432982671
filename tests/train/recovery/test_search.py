"""The search for maneuvers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from kinemimic.evaluate.policies.recipe import POLICIES
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.recovery import Recovery
from kinemimic.train.recovery.maneuver import COLUMNS, KNOTS
from kinemimic.train.recovery.search import SearchTask, search
from kinemimic.train.rollout.policy import POLICY, Policy
from kinemimic.train.sim.engines import resolve


def task(
    walk: Motion, trained: tuple[Policy, TrainConfig], settings: Recovery, phase: float = 0.02
) -> SearchTask:
    policy, config = trained
    return SearchTask(
        walk, policy, config.measured_env, settings, phase, 0.02, np.pi, np.random.SeedSequence(1),
        resolve("auto"),
    )  # fmt: skip


def test_the_same_seed_finds_the_same(walk: Motion, trained: tuple[Policy, TrainConfig]) -> None:
    small = trained[1].recovery
    assert small is not None
    first, second = (search(task(walk, trained, small)) for _ in range(2))
    np.testing.assert_array_equal(first.knots, second.knots)
    assert (first.before, first.after) == (second.before, second.after)
    assert first.knots.shape == (KNOTS, len(COLUMNS))
    assert first.knots.any()


def test_what_is_survived_anyway_needs_no_maneuver(walk: Motion, trained: tuple[Policy, TrainConfig]) -> None:
    small = trained[1].recovery
    assert small is not None
    found = search(task(walk, trained, replace(small, forces=(5.0, 10.0))))
    assert (found.before, found.after) == (1.0, 1.0)
    assert not found.knots.any()


@pytest.mark.slow
def test_pushes_under_which_the_tracker_often_falls_can_be_survived(walk: Motion) -> None:
    policy, record = Policy.load(POLICIES / "tracker" / POLICY)
    config = TrainConfig.from_json(record["config"])
    settings = replace(Recovery(), forces=(200.0, 240.0))
    found = search(task(walk, (policy, config), settings, phase=0.25))
    assert found.before <= 0.5
    assert found.after > 0.8
