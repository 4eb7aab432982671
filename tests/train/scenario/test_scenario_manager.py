"""Scenarios in the simulation: exactly the events of the schedules happen."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from kinemimic.retarget.humanoid.body import BODIES, BODY_INDEX
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.env_config import EnvConfig
from kinemimic.train.reference.reference import Reference
from kinemimic.train.sampling.sampler import Sampler
from kinemimic.train.scenario.scenario import Load, Placement, Range, Scenario
from kinemimic.train.sim.engines import open_world
from kinemimic.train.task.env import ACTIONS, ImitationBatch

PULL = Load("torso", Range.of(0.2), Range.of(0.2), force=Range.of(60.0, -20.0, 0.0))
BALL = Placement("sphere", Range.of(0.3, 0.3, 0.3), Range.of(1.5, 0.8, 1.0), mass=Range.of(1.0))
ALL = Scenario(
    "all",
    friction=Range((0.5,), (0.9,)),
    loads=(replace(PULL, at=Range((0.0,), (0.3,))),),
    obstacles=(
        BALL,
        replace(BALL, at=Range.of(0.2), velocity=Range.of(-2.0, -2.0, 1.0), spin=Range.of(1.0, 2.0, 3.0)),
        Placement("box", Range.of(0.4, 0.4, 0.9), Range((0.8, -0.2), (1.2, 0.2)), mass=Range.of(3.0)),
    ),
)
STEPS = 18


@pytest.fixture
def batch(engine: str, motion: Motion) -> Iterator[ImitationBatch]:
    made = ImitationBatch(open_world(2, engine), Reference(motion), EnvConfig(mirror=False, scenario=ALL))
    yield made
    made.world.close()


def lived(batch: ImitationBatch, steps: int) -> list[np.ndarray]:
    """Observations of each step, with the obstacles."""
    seen = []
    for _ in range(steps):
        seen.append(batch.step(np.zeros((batch.world.size, ACTIONS))).observations)
        seen += [batch.world.obstacles(k) for k in range(batch.world.size)]
    return seen


def begin(batch: ImitationBatch, *seeds: int) -> None:
    batch.reset(np.arange(2), np.array([0.0, 0.4]), seeds=np.array(seeds, dtype=np.uint64))


def test_a_scenarios_force_equals_the_same_external_force(engine: str, motion: Motion) -> None:
    """Equal to the bit to the same external wrench."""
    ends = []
    for scenario in (Scenario("pull", loads=(PULL,)), None):
        batch = ImitationBatch(open_world(1, engine), Reference(motion), EnvConfig(scenario=scenario))
        batch.reset(np.array([0]), np.zeros(1), seeds=np.zeros(1, dtype=np.uint64))
        for age in range(STEPS):
            wrench = np.zeros((1, len(BODIES), 6))
            if scenario is None and 6 <= age < 12:
                wrench[0, BODY_INDEX["torso"], :3] = [60.0, -20.0, 0.0]
            batch.step(np.zeros((1, ACTIONS)), wrench)
        ends.append(batch.bodies.positions.copy())
        batch.world.close()
    np.testing.assert_array_equal(ends[0], ends[1])


def test_events_depend_on_the_seed_only(batch: ImitationBatch) -> None:
    begin(batch, 1, 2)
    first = lived(batch, STEPS)
    begin(batch, 1, 3)
    again = lived(batch, STEPS)
    for a, b in zip(first[::3], again[::3], strict=True):
        np.testing.assert_array_equal(a[0], b[0])
    assert any((a[1] != b[1]).any() for a, b in zip(first[::3], again[::3], strict=True))


def test_obstacles_appear_at_their_time_and_position(batch: ImitationBatch) -> None:
    begin(batch, 1, 2)
    assert [len(batch.world.obstacles(k)) for k in range(2)] == [2, 2]
    lived(batch, 6)
    assert [len(batch.world.obstacles(k)) for k in range(2)] == [2, 2]
    before = batch.world.obstacles(0)
    lived(batch, 1)
    after = batch.world.obstacles(0)
    assert len(after) == 3
    # What was there goes on: a ball that falls freely, 0.2 s down and then one control step more.
    assert before[0, 9] == pytest.approx(-9.81 * 0.2, rel=1e-3)
    assert after[0, 9] == pytest.approx(-9.81 * (0.2 + 1 / 30), rel=1e-3)
    # What came flies with its speed and spin.
    np.testing.assert_allclose(after[2, 7:9], [-2.0, -2.0], atol=1e-6)
    np.testing.assert_allclose(after[2, 10:13], [1.0, 2.0, 3.0], atol=1e-6)


def test_without_seeds_nothing_happens(batch: ImitationBatch, engine: str, motion: Motion) -> None:
    begin(batch, 1, 2)
    lived(batch, 3)
    batch.reset(np.arange(2), np.array([0.0, 0.4]))
    assert [len(batch.world.obstacles(k)) for k in range(2)] == [0, 0]
    calm = ImitationBatch(open_world(2, engine), Reference(motion), EnvConfig(mirror=False))
    calm.reset(np.arange(2), np.array([0.0, 0.4]))
    for a, b in zip(lived(batch, 6), lived(calm, 6), strict=True):
        np.testing.assert_array_equal(a, b)
    calm.world.close()


@pytest.mark.parametrize("age", [0, 3, 6, 10])
def test_a_snapshot_is_reproducible(batch: ImitationBatch, engine: str, motion: Motion, age: int) -> None:
    """Also in a new world, with obstacles in flight."""
    if engine == "pybullet" and age == 10:
        pytest.skip("the order of several contacts depends on pybullet's past, and the last digits with it")
    begin(batch, 5, 6)
    lived(batch, age)
    snapshot = batch.snapshot()
    batch.restore(snapshot)
    first = lived(batch, STEPS - age)
    other = ImitationBatch(open_world(2, engine), Reference(motion), batch.config)
    other.restore(snapshot)
    for a, b in zip(first, lived(other, STEPS - age), strict=True):
        np.testing.assert_array_equal(a, b)
    assert len(other.world.obstacles(0)) == 3
    other.world.close()


def test_an_episode_has_its_scenarios_length_and_phase(engine: str, motion: Motion) -> None:
    short = replace(ALL, seconds=0.2, phase=Range.of(0.25))
    sampler = Sampler(motion, EnvConfig(scenario=short), np.random.SeedSequence(0).spawn(2), engine)
    sampler.begin_round(EnvConfig().reward)
    np.testing.assert_array_equal(sampler.batch.phases, 0.25)
    ends = [sampler.batch.step(np.zeros((2, ACTIONS))).truncated.tolist() for _ in range(6)]
    assert ends == [[False, False]] * 5 + [[True, True]]
    sampler.batch.world.close()
