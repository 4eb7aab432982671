"""Domain randomization: ranges, strength, and the time of pushes."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

from kinemimic.train.config.config import DomainRandomization
from kinemimic.train.sim.world import FRICTION
from kinemimic.train.task.domain_randomization import MAX_PUSHES, PUSH_STEPS, RandomizationSample, draw

HARD = DomainRandomization(
    push=(50.0, 200.0),
    rest=(0.5, 1.0),
    friction=(0.4, 1.0),
    mass=(0.8, 1.1),
    delay=(0.0, 0.02),
    tilt=0.1,
    spin=0.5,
)


def many(strength: float) -> RandomizationSample:
    random = np.random.default_rng(0)
    return RandomizationSample.concatenated([draw(HARD, strength, random) for _ in range(500)])


def test_draws_fill_their_ranges_and_stay_inside() -> None:
    found = many(1.0)
    sizes = np.linalg.norm(found.forces, axis=-1)
    for values, low, high in (
        (sizes, 50.0, 200.0),
        (found.friction, 0.4, 1.0),
        (found.mass, 0.8, 1.1),
        (found.delay / 240.0, 0.0, 0.0209),
    ):
        assert low <= values.min() < low + 0.1 * (high - low)
        assert high - 0.1 * (high - low) < values.max() <= high
    assert found.tilts.std() == pytest.approx(0.1, rel=0.05)
    assert found.spins.std() == pytest.approx(0.5, rel=0.05)
    # From every side alike.
    assert np.abs(found.forces.mean(axis=(0, 1))).max() < 5.0
    waits = np.diff(found.begins, axis=1) - PUSH_STEPS
    assert 14 <= waits.min() < waits.max() <= 31
    assert found.begins[:, 0].min() >= 14


def test_half_the_strength_halves_the_deviation() -> None:
    full, half = many(1.0), many(0.5)
    np.testing.assert_allclose(half.forces, 0.5 * full.forces)
    np.testing.assert_allclose(half.friction - FRICTION, 0.5 * (full.friction - FRICTION))
    np.testing.assert_allclose(half.mass - 1.0, 0.5 * (full.mass - 1.0))
    np.testing.assert_allclose(half.tilts, 0.5 * full.tilts)


def test_without_strength_or_ranges_nothing_is_drawn() -> None:
    calm, random = RandomizationSample.nominal(1), np.random.default_rng(1)
    before = random.bit_generator.state
    for found in (draw(HARD, 0.0, random), draw(DomainRandomization(), 1.0, random)):
        for f in fields(RandomizationSample):
            np.testing.assert_array_equal(getattr(found, f.name), getattr(calm, f.name))
    assert random.bit_generator.state == before


def test_a_push_acts_on_the_pelvis_for_a_fifth_of_a_second() -> None:
    randomization = RandomizationSample.nominal(2)
    randomization.begins[0, :2], randomization.forces[0, :2] = [3, 20], [[10.0, -5.0], [0.0, 7.0]]
    pushed = []
    for age in range(40):
        wrenches = randomization.pushes(np.array([age, age]))
        if wrenches is not None:
            pushed.append(age)
            assert wrenches.shape == (2, 15, 6)
            assert not wrenches[1].any()
            assert not wrenches[0, 1:].any()
            np.testing.assert_array_equal(wrenches[0, 0], [*((10, -5) if age < 10 else (0, 7)), 0, 0, 0, 0])
    assert pushed == [*range(3, 9), *range(20, 26)]


def test_assign_sets_the_selected_environments() -> None:
    whole, part = RandomizationSample.nominal(3), many(1.0)
    chosen = RandomizationSample(*(getattr(part, f.name)[:2] for f in fields(RandomizationSample)))
    whole.assign(np.array([2, 0]), chosen)
    np.testing.assert_array_equal(whole.mass, [part.mass[1], 1.0, part.mass[0]])
    assert whole.begins.shape == (3, MAX_PUSHES)
