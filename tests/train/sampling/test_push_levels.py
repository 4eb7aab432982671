"""Pushes that adapt: to each environment and direction, by hand-computed levels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from peers.constant import constant

from kinemimic.pipeline.files.validation.records import RecordError
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.env_config import DomainRandomization, EnvConfig
from kinemimic.train.sampling.push_levels import FALL, FIRST, HIGHEST, LOWEST, PROBATION, RISE, PushLevels
from kinemimic.train.sampling.sampler import Sampler
from kinemimic.train.task.domain_randomization import MAX_PUSHES, RandomizationSample
from kinemimic.train.task.env import ACTIONS

TOP = 400.0
NORTH = np.array([[0.0, 1.2]])  # the reference walks along y


def pushes(*forces: tuple[float, float], begins: tuple[int, ...]) -> RandomizationSample:
    """A sample of one environment with these pushes."""
    sample = RandomizationSample.nominal(1)
    sample.begins[0] = 10_000 + np.arange(MAX_PUSHES)
    sample.begins[0, : len(begins)] = begins
    sample.forces[0, : len(forces)] = forces
    return sample


def begun(*forces: tuple[float, float], begins: tuple[int, ...]) -> tuple[PushLevels, RandomizationSample]:
    levels = PushLevels(1)
    return levels, levels.applied(pushes(*forces, begins=begins), np.array([0]), NORTH, TOP)


def lived(levels: PushLevels, ages: range, fell_at: int | None = None) -> None:
    for age in ages:
        levels.update(np.array([age]), np.array([age == fell_at]))


def test_the_largest_push_is_the_level_of_its_direction() -> None:
    levels = PushLevels(1)
    levels.levels[0] = 100.0 + 10.0 * np.arange(8)
    # Forward, to the left and, half as hard, backward of somebody who walks along y.
    sample = pushes((0.0, TOP), (-TOP, 0.0), (0.0, -TOP / 2.0), begins=(30, 90, 150))
    applied = levels.applied(sample, np.array([0]), NORTH, TOP)
    np.testing.assert_allclose(applied.forces[0, :3], [(0.0, 100.0), (-120.0, 0.0), (0.0, -70.0)], atol=1e-9)
    assert not applied.forces[0, 3:].any()
    np.testing.assert_array_equal(applied.begins, sample.begins)


def test_a_level_rises_when_its_push_was_survived() -> None:
    levels, _ = begun((0.0, TOP), begins=(30,))
    lived(levels, range(1, 30 + PROBATION))
    assert (levels.levels == FIRST).all()
    lived(levels, range(30 + PROBATION, 200))
    np.testing.assert_allclose(levels.levels[0], [RISE * FIRST, *[FIRST] * 7])


def test_a_level_sinks_when_the_policy_falls_after_its_push() -> None:
    levels, _ = begun((TOP, 0.0), begins=(30,))
    lived(levels, range(1, 60), fell_at=59)
    np.testing.assert_allclose(levels.levels[0], [*[FIRST] * 6, FALL * FIRST, FIRST])  # the right


def test_a_fall_belongs_to_the_last_push() -> None:
    levels, _ = begun((0.0, TOP), (0.0, -TOP), begins=(30, 50))
    lived(levels, range(1, 71), fell_at=70)
    np.testing.assert_allclose(levels.levels[0], [RISE * FIRST, *[FIRST] * 3, FALL * FIRST, *[FIRST] * 3])


@pytest.mark.parametrize(("share", "fell_at"), [(0.5, 59), (0.5, None), (1.0, 29), (1.0, 100)])
def test_a_weak_push_and_a_fall_at_another_time_change_nothing(share: float, fell_at: int | None) -> None:
    levels, _ = begun((0.0, share * TOP), begins=(30,))
    levels.levels[0, 0] = HIGHEST  # whatever is survived
    lived(levels, range(1, 120 if fell_at is None else fell_at + 1), fell_at)
    np.testing.assert_array_equal(levels.levels[0], [HIGHEST, *[FIRST] * 7])


def test_levels_stay_in_their_range() -> None:
    levels, _ = begun((0.0, TOP), begins=(30,))
    levels.levels[0, 0] = 1.01 * LOWEST
    lived(levels, range(1, 41), fell_at=40)
    assert levels.levels[0, 0] == LOWEST


def test_half_of_the_pushes_survived_leave_the_level_where_it_is() -> None:
    assert 0.5 * np.log(RISE) + 0.5 * np.log(FALL) == pytest.approx(0.0, abs=0.006)


def test_a_restored_sampler_goes_the_same_way(motion: Motion, engine: str) -> None:
    config = replace(
        EnvConfig(),
        domain_randomization=DomainRandomization(push=(100.0, 300.0), adaptive_push=True, rest=(0.05, 0.1)),
    )
    seeds = np.random.SeedSequence(4).spawn(3)
    one, other = (Sampler(motion, config, seeds, engine) for _ in range(2))
    still, none = constant(), np.zeros(ACTIONS, dtype=np.float32)
    one.sample(still, none, config.reward, 1.0, 40)
    states = one.env_states()
    assert (states["push_levels"] != FIRST).any()
    other.set_env_states(states)
    samples = [sampler.sample(still, none, config.reward, 1.0, 40) for sampler in (one, other)]
    np.testing.assert_array_equal(*(found.observations for found in samples))
    levels = [sampler.env_states()["push_levels"] for sampler in (one, other)]
    np.testing.assert_array_equal(*levels)
    assert (levels[0] != states["push_levels"]).any()


def test_adaptive_pushes_need_a_size() -> None:
    with pytest.raises(RecordError, match="an upper end above 0 N"):
        DomainRandomization(adaptive_push=True)
