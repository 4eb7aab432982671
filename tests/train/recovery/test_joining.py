"""A policy learns to act as teachers near obstacles, and elsewhere as before."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.joining import Joining
from kinemimic.train.recovery import joining, learning
from kinemimic.train.recovery.among_obstacles import begin_among_obstacles, survived_among_obstacles
from kinemimic.train.recovery.joining import Gate, join
from kinemimic.train.recovery.teachers import TaughtActions, Teachers, load_teachers
from kinemimic.train.reference.reference import Reference
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.settings import settings_for
from kinemimic.train.sim.engines import open_world, resolve
from kinemimic.train.task.env import ImitationBatch
from kinemimic.train.task.obstacle_observation import obstacle_observation_size

Start = tuple[Policy, TrainConfig]
TEACHERS = Path(__file__).parents[3] / "datasets/comparison/walk@several-obstacles/td3"


@pytest.fixture(scope="module")
def start(walk: Motion) -> Start:
    """`robust_walk` as a training among obstacles begins, with settings for a small joining."""
    found = settings_for(walk, start="robust_walk", preset_name="obstacles", teachers=TEACHERS)
    assert found.initial is not None
    return found.initial, replace(found.config, joining=Joining(rounds=2, humanoids=6))


@pytest.fixture(scope="module")
def teachers(start: Start) -> Teachers:
    """The policies of the comparison that TD3 trained among obstacles."""
    return load_teachers(TEACHERS, start[1].env)


@pytest.fixture
def batch(walk: Motion, start: Start) -> Iterator[ImitationBatch]:
    world = open_world(6, resolve("auto"))
    yield ImitationBatch(world, Reference(walk), start[1].measured_env)
    world.close()


def leaning(policy: Policy) -> Policy:
    """The policy with another action in every state."""
    *others, (weight, bias) = policy.layers
    return replace(policy, layers=(*others, (weight, bias + np.float32(0.05))))


def test_a_gate_asks_whether_an_obstacle_is_observed(
    batch: ImitationBatch, start: Start, teachers: Teachers
) -> None:
    policy, config = start
    size = obstacle_observation_size(config.env.observed_obstacles)
    seen = begin_among_obstacles(batch, np.random.default_rng(2)).copy()
    seen[:3, -size:] = 0.0
    seen[3:, -size:] = 1.0
    found = Gate(batch, teachers, policy).act(seen)
    np.testing.assert_array_equal(found[:3], policy.act(seen)[:3])
    np.testing.assert_array_equal(found[3:], TaughtActions(batch, teachers).act()[3:])


def test_lessons_say_what_the_gate_would_do_where_the_pupil_is(
    batch: ImitationBatch, start: Start, teachers: Teachers
) -> None:
    policy, config = start
    size = obstacle_observation_size(config.env.observed_obstacles)
    gate = Gate(batch, teachers, policy)
    random = np.random.default_rng(4)
    for lesson, share in ((joining._lesson_among_obstacles, 0.4), (joining._lesson_with_pushes, 0.0)):
        for pupil in (None, leaning(policy)):
            seen, wanted = lesson(batch, gate, pupil, 0.0, random)
            assert seen.dtype == wanted.dtype == np.float32
            assert len(seen) > 6 * 40
            near = seen[:, -size:].any(axis=1)
            assert near.mean() > share if share else not near.any()
            np.testing.assert_allclose(wanted[~near], policy.act(seen[~near]), atol=1e-5)
            if share:
                assert np.abs(wanted[near] - policy.act(seen[near])).max() > 0.1


def test_every_humanoid_has_its_own_obstacles(batch: ImitationBatch, start: Start) -> None:
    found = []
    for _ in range(2):
        begin_among_obstacles(batch, np.random.default_rng(5))
        found.append([batch.world.placed(k)[0].position for k in range(6)])
    assert found[0] == found[1]
    assert len(set(found[0])) == 6
    # Without corrections, most fall at the first, if not before.
    idle = replace(start[0], layers=tuple((0.0 * weight, 0.0 * bias) for weight, bias in start[0].layers))
    assert survived_among_obstacles(batch, idle, np.random.default_rng(5)).sum() <= 3


def test_the_best_round_is_kept_and_the_result_is_the_same(
    walk: Motion, start: Start, teachers: Teachers, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given, tested = [(0.8, 0.3), (0.8, 0.9), (0.7, 0.7), (0.7, 0.8)], []

    def measured(_: object, tests: list[joining._Test], *, workers: int) -> list[tuple[float, float]]:
        first = len(tested) % len(given)
        tested.extend(test.policy for test in tests)
        return given[first : first + len(tests)]

    monkeypatch.setattr(joining, "parallel_map", measured)
    monkeypatch.setattr(joining, "_AMONG_OBSTACLES", 30)
    policy, config = start
    found = [
        join(walk, policy, teachers, config, tmp_path / name, workers=1, engine=resolve("auto"))
        for name in "ab"
    ]
    assert found[0].stage == "joining"
    assert found[0].record == found[1].record
    assert found[0].record["first"] == {"pushes": 0.8, "obstacles": 0.3}
    assert found[0].record["first_and_teachers"] == {"pushes": 0.8, "obstacles": 0.9}
    assert found[0].record["teachers"] == teachers.identity
    assert found[0].record["survived_by_round"][1] == {"pushes": 0.7, "obstacles": 0.8}
    assert len(tested) == 2 * len(given)
    assert found[0].policy is tested[3]
    for (a, _), (b, _) in zip(found[0].policy.layers, found[1].policy.layers, strict=True):
        np.testing.assert_array_equal(a, b)
    assert found[0].policy.shape == policy.shape


def test_pushes_and_obstacles_are_tested_apart(
    walk: Motion, start: Start, teachers: Teachers, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`robust_walk` survives most weak pushes, and more of the trials among obstacles with the teachers."""
    monkeypatch.setattr(joining, "_TESTS", 12)
    monkeypatch.setattr(learning, "_TEST_FORCES", (100.0,))
    monkeypatch.setattr(learning, "_TEST_PHASES", 2)
    alone, together = (
        joining._shares(joining._Test(walk, *start, resolve("auto"), of)) for of in (None, teachers)
    )
    assert alone[0] == together[0] > 0.9
    assert 0.0 <= alone[1] < 0.75 <= together[1]


def test_teachers_that_do_not_help_are_refused_before_the_lessons(
    walk: Motion, start: Start, teachers: Teachers, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(joining, "parallel_map", lambda *_, workers: [(0.8, 0.42), (0.8, 0.4)])
    with pytest.raises(
        KinemimicError, match=r"--teachers: expected .* \(42%\), found 40%; were they trained on"
    ):
        join(walk, start[0], teachers, start[1], tmp_path, workers=1, engine="native")
    assert not [*tmp_path.iterdir()]


def test_only_a_policy_that_observes_obstacles_is_joined(
    walk: Motion, start: Start, teachers: Teachers, tmp_path: Path
) -> None:
    policy, config = start
    joined = partial(join, walk, policy, teachers, run=tmp_path, workers=1, engine="native")
    with pytest.raises(ValueError, match="expected a configuration with joining"):
        joined(config=replace(config, joining=None))
    with pytest.raises(ValueError, match="of a policy that observes obstacles"):
        joined(config=replace(config, env=replace(config.env, observed_obstacles=0)))
