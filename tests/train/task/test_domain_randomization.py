"""Domain randomization: ranges, strength, and the time of pushes."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.env_config import DomainRandomization, EnvConfig
from kinemimic.train.sim.world import FRICTION, Poses
from kinemimic.train.task.domain_randomization import MAX_PUSHES, PUSH_STEPS, RandomizationSample, draw

HARD = DomainRandomization(
    push=(50.0, 200.0),
    rest=(0.5, 1.0),
    friction=(0.4, 1.0),
    mass=(0.8, 1.1),
    delay=(0.0, 0.02),
    tilt=0.1,
    spin=0.5,
    displacement=0.3,
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
    distances = np.linalg.norm(found.displacement, axis=-1)
    assert distances.min() < 0.03 < 0.27 < distances.max() <= 0.3
    np.testing.assert_array_equal(found.displacement[:, 2], 0.0)
    assert np.abs(found.displacement.mean(axis=0)).max() < 0.02
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
    np.testing.assert_allclose(half.displacement, 0.5 * full.displacement)


def test_ranges_of_later_versions_do_not_change_the_draws() -> None:
    """Of policies that were trained before: same seed, same episodes. Without a displacement, a draw takes
    from the generator what it took in the first version: rests, directions and sizes of the pushes, friction,
    mass and delay, then tilts and spins."""
    drawn, counted = np.random.default_rng(3), np.random.default_rng(3)
    old = draw(replace(HARD, displacement=0.0), 1.0, drawn)
    assert not old.displacement.any()
    pushes = [counted.uniform(size=MAX_PUSHES) for _ in range(3)]
    counted.uniform(size=3)
    turns = [counted.standard_normal((15, 3)) for _ in range(2)]
    assert drawn.bit_generator.state == counted.bit_generator.state
    angles = np.arctan2(old.forces[0, :, 1], old.forces[0, :, 0])
    np.testing.assert_allclose(angles, np.pi * (2.0 * pushes[1] - 1.0), atol=1e-12)
    np.testing.assert_allclose(old.tilts[0], HARD.tilt * turns[0])
    # With one, the rest of the episode is the same, and the length and direction follow.
    drawn = np.random.default_rng(3)
    new = draw(HARD, 1.0, drawn)
    for f in fields(RandomizationSample):
        if f.name != "displacement":
            np.testing.assert_array_equal(getattr(new, f.name), getattr(old, f.name))
    counted.uniform(size=2)
    assert new.displacement.any()
    assert drawn.bit_generator.state == counted.bit_generator.state
    stated = TrainConfig(env=EnvConfig(domain_randomization=replace(HARD, displacement=0.0))).to_json()
    assert not {"displacement", "pace"} & stated["env"]["domain_randomization"].keys()
    assert TrainConfig.from_json(stated).env.domain_randomization == replace(HARD, displacement=0.0)


def test_an_episode_has_obstacles_or_pushes() -> None:
    random, cluttered = np.random.default_rng(0), replace(HARD, obstacles=0.6)
    for strength in (1.0, 0.5):
        drawn = [draw(cluttered, strength, random) for _ in range(1000)]
        among = np.array([bool(one.clutter[0]) for one in drawn])
        assert among.mean() == pytest.approx(0.6 * strength, abs=0.05)
        assert not np.concatenate([one.forces for one in drawn])[among].any()
        assert np.concatenate([one.forces for one in drawn])[~among].any(axis=(1, 2)).all()
        assert len({int(one.clutter[0]) for one in drawn}) == among.sum() + 1


def test_an_episode_starts_beside_its_reference() -> None:
    calm = RandomizationSample.nominal(2)
    calm.displacement[1] = [0.2, -0.1, 0.0]
    poses = Poses(*(np.ones((2, n)) for n in (3, 4, 3, 3)), np.ones((2, 14, 4)), np.ones((2, 14, 3)))
    moved = calm.perturbed(poses).root - poses.root
    np.testing.assert_allclose(moved, [[0.0, 0.0, 0.0], [0.2, -0.1, 0.0]])


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
