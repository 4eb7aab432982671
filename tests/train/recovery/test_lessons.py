"""Lessons: what the teacher would do where the pupil is."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kinemimic.train.config.config import TrainConfig
from kinemimic.train.recovery import lessons
from kinemimic.train.recovery.lessons import Teacher, lesson
from kinemimic.train.recovery.maneuver import COLUMNS, KNOTS
from kinemimic.train.recovery.search import Found
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.task.env import ImitationBatch

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
