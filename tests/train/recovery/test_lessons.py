"""Lessons: what the teacher would do where the pupil is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.recovery import lessons
from kinemimic.train.recovery.among_obstacles import survived_among_obstacles
from kinemimic.train.recovery.lessons import Teacher, lesson, lesson_among_obstacles
from kinemimic.train.recovery.maneuver import COLUMNS, KNOTS
from kinemimic.train.recovery.search import Found
from kinemimic.train.reference.reference import Reference
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.settings import settings_for
from kinemimic.train.sim.engines import open_world, resolve
from kinemimic.train.task.env import ImitationBatch
from kinemimic.train.task.observation import observation_size
from kinemimic.train.task.obstacle_observation import LEGS_SIZE, OBSTACLE_SIZE

Humanoids = Callable[[int], ImitationBatch]
Trained = tuple[Policy, TrainConfig]


def taught(knots: np.ndarray) -> list[Found]:
    return [Found(phase=0.2, direction=np.pi, before=0.0, after=1.0, samples=1, knots=knots)]


def given(
    batch: ImitationBatch, trained: Trained, knots: np.ndarray, pupil: Policy | None, noise: float = 0.0
):  # type: ignore[no-untyped-def]
    settings = trained[1].recovery
    assert settings is not None
    teacher = Teacher(trained[0], taught(knots), 0.05)
    return lesson(batch, teacher, pupil, settings, noise, np.random.default_rng(3))


def test_without_a_maneuver_the_teacher_is_the_policy(humanoids: Humanoids, trained: Trained) -> None:
    seen, wanted = given(humanoids(9), trained, np.zeros((KNOTS, len(COLUMNS))), None)
    np.testing.assert_allclose(wanted, trained[0].act(seen), atol=1e-5)
    assert seen.dtype == wanted.dtype == np.float32


def test_a_maneuver_changes_its_own_columns_alone(humanoids: Humanoids, trained: Trained) -> None:
    seen, wanted = given(humanoids(9), trained, np.full((KNOTS, len(COLUMNS)), 0.1), None)
    changed = np.abs(wanted - trained[0].act(seen)) > 1e-4
    assert changed.any(axis=0).sum() == len(COLUMNS)
    assert set(np.flatnonzero(changed.any(axis=0))) == set(COLUMNS)
    # Before the push, in the humanoids pushed from elsewhere, and after the maneuver, nothing is changed.
    assert 0.05 < changed.any(axis=1).mean() < 0.6


def test_the_teacher_says_what_to_do_where_the_pupil_is(humanoids: Humanoids, trained: Trained) -> None:
    still = Policy(
        tuple((np.zeros_like(weight), np.zeros_like(bias)) for weight, bias in trained[0].layers),
        trained[0].mean, trained[0].scale, limit=trained[0].limit,
    )  # fmt: skip
    none = np.zeros((KNOTS, len(COLUMNS)))
    own, _ = given(humanoids(9), trained, none, None)
    seen, wanted = given(humanoids(9), trained, none, still)
    np.testing.assert_allclose(wanted, trained[0].act(seen), atol=1e-5)
    assert len(seen) != len(own) or not np.array_equal(seen, own)


def test_among_obstacles_the_teacher_is_the_policy(walk: Motion) -> None:
    found = settings_for(walk, start="robust_walk", preset_name="obstacles")
    assert found.initial is not None
    batch = ImitationBatch(open_world(6, resolve("auto")), Reference(walk), found.config.measured_env)
    random = np.random.default_rng(4)
    seen, wanted = lesson_among_obstacles(batch, found.initial, None, 0.0, random)
    assert seen.shape[1] == observation_size(found.config.env)
    np.testing.assert_allclose(wanted, found.initial.act(seen), atol=1e-5)
    # Most steps of every humanoid that is upright, in sight of an obstacle.
    assert 6 * 60 < len(seen) <= 6 * 210
    obstacles = found.config.env.observed_obstacles * OBSTACLE_SIZE + LEGS_SIZE
    assert seen[:, -obstacles:].any(axis=1).mean() > 0.4
    # Without corrections, the humanoid falls at the first obstacle, if not before.
    idle = replace(found.initial, layers=tuple((0.0 * w, 0.0 * b) for w, b in found.initial.layers))
    survived = [survived_among_obstacles(batch, policy, np.random.default_rng(5)) for policy in (idle, idle)]
    np.testing.assert_array_equal(survived[0], survived[1])
    assert survived[0].sum() <= 3
    batch.world.close()


def test_pushes_from_elsewhere_are_apart_from_those_searched() -> None:
    random = np.random.default_rng(0)
    searched = np.radians([180.0, 90.0, -90.0])
    found = lessons._elsewhere(searched, 500, random)
    assert found.shape == (500,)
    assert off(found, searched).min() >= 45.0 - 1e-9
    assert np.abs(found).min() < np.radians(2.0)
    # Where none is so far apart, those that are farthest are taken.
    everywhere = np.radians(np.arange(0.0, 360.0, 45.0))
    np.testing.assert_allclose(off(lessons._elsewhere(everywhere, 500, random), everywhere), 22.5)


def off(angles: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Degrees from each angle to the nearest other one."""
    turns = np.mod(np.degrees(angles[:, None] - others) + 180.0, 360.0) - 180.0
    nearest: np.ndarray = np.abs(turns).min(axis=1)
    return nearest
