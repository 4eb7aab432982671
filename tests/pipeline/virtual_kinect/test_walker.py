"""The walker varies as people do, at the level asked for, and stands on its feet."""

from __future__ import annotations

import numpy as np
import pytest
from peers.straight_walk import straight_walk

from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.readers.mocap.deepmimic import read_deepmimic, stock_motion
from kinemimic.pipeline.virtual_kinect.subject import Gait, GroundTruth, close_loop
from kinemimic.pipeline.virtual_kinect.variability import Variability
from kinemimic.pipeline.virtual_kinect.walker import SPEEDS, at_speed, person, walk

RATE = 120.0
PERSONS = 6


@pytest.fixture(scope="module")
def stock() -> Gait:
    return close_loop(read_deepmimic(stock_motion("walk")))


def _walk(
    stock: Gait, factor: float, seed: int, *, seconds: float = 40.0, speed: float | None = None
) -> GroundTruth:
    levels = Variability.measured(factor)
    gait = person(stock, levels, np.random.default_rng([seed, 1]), speed)
    return walk(
        gait,
        np.arange(0.0, seconds, 1.0 / RATE),
        start=np.zeros(2),
        heading=0.5,
        phase=0.3,
        levels=levels,
        rng=np.random.default_rng([seed, 2]),
    )


@pytest.fixture(scope="module")
def walks(stock: Gait) -> dict[float, list[GroundTruth]]:
    """By level: one walk of each person."""
    return {factor: [_walk(stock, factor, seed) for seed in range(PERSONS)] for factor in (0.0, 1.0, 2.0)}


def _crossings(truth: GroundTruth) -> tuple[np.ndarray, np.ndarray]:
    """Times at which the right ankle passes the left, and the left the right."""
    ahead = np.stack([np.cos(truth.heading), np.sin(truth.heading)], axis=-1)
    apart = truth.joints[:, N["ankle_right"], :2] - truth.joints[:, N["ankle_left"], :2]
    along = np.sum(apart * ahead, axis=-1)
    found = []
    for sign in (1.0, -1.0):
        y = sign * along
        k = np.flatnonzero((y[:-1] < 0) & (y[1:] >= 0))
        found.append((k - y[k] / (y[k + 1] - y[k])) / RATE)
    return found[0], found[1]


def _stride_time_variation(truths: list[GroundTruth]) -> float:
    """Of consecutive strides, relative: as measured on people."""
    changes = []
    for truth in truths:
        for events in _crossings(truth):
            strides = np.diff(events)
            changes.append(np.diff(strides) / strides.mean() / np.sqrt(2.0))
    return float(np.sqrt(np.mean(np.concatenate(changes) ** 2)))


def test_without_variability_it_is_the_cycle(stock: Gait) -> None:
    times = np.arange(90) / 30.0
    exact = straight_walk(stock, times, start=np.ones(2), heading=0.7, phase=0.3)
    gait = person(stock, Variability.measured(0.0), np.random.default_rng(0))
    walked = walk(
        gait,
        times,
        start=np.ones(2),
        heading=0.7,
        phase=0.3,
        levels=Variability.measured(0.0),
        rng=np.random.default_rng(1),
    )
    # The person's cycle is sampled anew.
    np.testing.assert_allclose(walked.joints, exact.joints, atol=1e-3)
    for name, curve in exact.angles.items():
        np.testing.assert_allclose(walked.angles[name], curve, atol=np.radians(0.1))


def test_stride_times_vary_as_asked(walks: dict[float, list[GroundTruth]]) -> None:
    none, once, twice = (_stride_time_variation(walks[factor]) for factor in (0.0, 1.0, 2.0))
    # 2.3 % of CMU's walkers, by the times at which their ankles pass.
    assert none < 1e-3
    assert once == pytest.approx(0.023, rel=0.25)
    assert twice == pytest.approx(2.0 * once, rel=0.25)


def test_knees_vary_in_amplitude_as_asked(walks: dict[float, list[GroundTruth]]) -> None:
    found = {}
    for factor, truths in walks.items():
        changes = []
        for truth in truths:
            stride = np.floor(truth.phase).astype(int)
            whole = range(stride[0] + 1, stride[-1])
            bends = np.array([np.ptp(truth.angles["knee_left"][stride == k]) for k in whole])
            changes.append(np.diff(bends) / bends.mean() / np.sqrt(2.0))
        found[factor] = float(np.sqrt(np.mean(np.concatenate(changes) ** 2)))
    assert found[0.0] < 1e-3
    assert 0.03 < found[1.0] < 0.06
    assert found[2.0] == pytest.approx(2.0 * found[1.0], rel=0.25)


def _curve(truth: GroundTruth, name: str, shift: float) -> np.ndarray:
    """The mean (50,) of an angle over all strides, in degrees."""
    bins = (np.mod(truth.phase + shift, 1.0) * 50).astype(int)
    return np.degrees(np.bincount(bins, truth.angles[name]) / np.bincount(bins))


def test_left_and_right_differ_by_person(walks: dict[float, list[GroundTruth]]) -> None:
    gaps = {
        factor: np.array([
            np.sqrt(np.mean((_curve(truth, "knee_left", 0.0) - _curve(truth, "knee_right", 0.5)) ** 2))
            for truth in truths
        ])
        for factor, truths in walks.items()
    }  # fmt: skip
    assert gaps[0.0].max() < 0.5
    # People's knees: 1.5 to 4.8 degrees.
    assert 1.5 < np.sqrt(np.mean(gaps[1.0] ** 2)) < 4.8
    assert np.ptp(gaps[1.0]) > 0.5


def test_no_series_pooled_over_the_phase_explains_the_strides(walks: dict[float, list[GroundTruth]]) -> None:
    for truth in walks[1.0]:
        angle = 2.0 * np.pi * truth.phase[:, None] * np.arange(1, 9)
        columns = np.concatenate([np.ones((len(angle), 1)), np.cos(angle), np.sin(angle)], axis=1)
        knee = np.degrees(truth.angles["knee_left"])
        rest = knee - columns @ np.linalg.lstsq(columns, knee, rcond=None)[0]
        assert 1.0 < rest.std() < 6.0


def test_the_speed_is_the_one_asked_for(stock: Gait) -> None:
    low, high = SPEEDS["walk"]
    for speed in (low, 1.2, high):
        assert at_speed(stock, speed).speed == pytest.approx(speed, rel=1e-6)
        truth = _walk(stock, 1.0, 7, speed=speed)
        steps = np.diff(truth.joints[:: int(RATE), N["hip_center"], :2], axis=0)
        assert np.linalg.norm(steps, axis=-1).mean() == pytest.approx(speed, rel=0.05)


def test_a_faster_walker_takes_longer_and_more_steps(stock: Gait) -> None:
    slow, fast = at_speed(stock, 0.8), at_speed(stock, 1.6)
    assert fast.stride / slow.stride == pytest.approx(np.sqrt(2.0), rel=1e-6)
    assert slow.period / fast.period == pytest.approx(np.sqrt(2.0), rel=1e-6)


@pytest.mark.parametrize("motion", ["walk", "run"])
def test_standing_feet_stay_and_knees_bend_one_way(motion: str) -> None:
    stock = close_loop(read_deepmimic(stock_motion(motion)))
    for seed in range(3):
        truth = _walk(stock, 1.0, seed, seconds=15.0, speed=SPEEDS[motion][1])
        for side in ("left", "right"):
            ankle = truth.joints[:, N[f"ankle_{side}"]]
            speed = np.linalg.norm(np.gradient(ankle[:, :2], 1.0 / RATE, axis=0), axis=-1)
            bins = (np.mod(truth.phase, 1.0) * 20).astype(int)
            by_phase = np.sort(np.bincount(bins, speed) / np.bincount(bins))
            # A walker's foot stands still for a fifth of the cycle; a runner's ankle moves even in contact.
            slow, share = {"walk": (3, 0.05), "run": (0, 0.1)}[motion]
            assert by_phase[slow] < share * SPEEDS[motion][1]
            knee = np.degrees(truth.angles[f"knee_{side}"])
            assert knee.min() > -10.0
            assert np.abs(np.diff(knee)).max() * RATE < 1500.0


def test_a_walker_who_means_to_turn_turns(stock: Gait) -> None:
    levels = Variability.measured(0.0)
    times = np.arange(0.0, 6.0, 1.0 / RATE)
    truth = walk(
        stock,
        times,
        start=np.array([0.0, -2.0]),
        heading=0.0,
        phase=0.0,
        turn=stock.speed / 2.0,
        levels=levels,
        rng=np.random.default_rng(0),
    )
    radius = np.linalg.norm(truth.joints[:, N["hip_center"], :2], axis=-1)
    np.testing.assert_allclose(radius, 2.0, atol=0.1)


def test_the_same_seed_walks_the_same(stock: Gait) -> None:
    one, two, other = (_walk(stock, 1.0, seed, seconds=3.0) for seed in (3, 3, 4))
    np.testing.assert_array_equal(one.joints, two.joints)
    assert not np.array_equal(one.joints, other.joints)
