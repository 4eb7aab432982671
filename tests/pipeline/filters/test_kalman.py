"""The Kalman smoother: the textbook recursions, invariances, and the weights of the tracking states."""

from __future__ import annotations

from typing import cast

import numpy as np
import pytest
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.filters.kalman import MIN_CUTOFF, Chain, Smoothed, smooth
from kinemimic.pipeline.kinematics.skeleton import INFERRED, MISSING, TRACKED

NOISE = 0.01


def clock(frames: int, seed: int = 0) -> Array:
    """30 Hz with a jitter of a few milliseconds."""
    return np.arange(frames) / 30.0 + np.random.default_rng(seed).uniform(-0.004, 0.004, frames)


def one_pass(frames: int) -> NDArray[np.int32]:
    return np.zeros(frames, dtype=np.int32)


def smoothed(
    values: Array, times: Array | None = None, states: NDArray[np.uint8] | None = None, **given: Array
) -> Smoothed:
    """The smoother on values (T, J, K), one pass and all tracked unless given otherwise."""
    frames = len(values)
    return smooth(
        values,
        clock(frames) if times is None else times,
        cast(NDArray[np.int32], given.get("passes", one_pass(frames))),
        np.full(values.shape[:2], TRACKED, np.uint8) if states is None else states,
        cast(NDArray[np.bool_], given.get("unknown", np.zeros(values.shape[:2], dtype=np.bool_))),
        given.get("credibility", np.ones(values.shape[:2])),
    )


def walk(frames: int, joints: int = 2, rate: float = 30.0) -> Array:
    """Smooth paths (T, J, 3): a steady advance and two harmonics of a 1 Hz stride."""
    t = np.arange(frames)[:, None, None] / rate
    phase = np.arange(3 * joints).reshape(joints, 3)
    return 1.2 * t + 0.2 * np.sin(2 * np.pi * t + phase) + 0.05 * np.sin(4 * np.pi * t + 2 * phase)


def textbook(y: Array, weights: Array, times: Array, step: float, stiffness: float) -> Array:
    """Rauch, Tung, Striebel written out for the state (x_k, x_(k-1)); the first two are measured.

    Second divided differences, times the square root of the mean step, are white with variance 1/stiffness:
    a x_(k-1) + b x_k + c x_(k+1) = e.
    """
    means, covariances = [np.array([y[1], y[0]])], [np.diag([1.0 / weights[1], 1.0 / weights[0]])]
    predicted: list[tuple[Array, Array, Array]] = []
    for k in range(1, len(y) - 1):
        before, after = (times[k] - times[k - 1]) / step, (times[k + 1] - times[k]) / step
        root = np.sqrt(2.0 / (before + after))
        a, c = root / before, root / after
        b = -a - c
        transition = np.array([[-b / c, -a / c], [1.0, 0.0]])
        mean = transition @ means[-1]
        covariance = transition @ covariances[-1] @ transition.T + np.diag([1.0 / (stiffness * c * c), 0.0])
        predicted.append((transition, mean, covariance))
        if weights[k + 1] > 0.0:
            gain = covariance[:, 0] / (covariance[0, 0] + 1.0 / weights[k + 1])
            mean = mean + np.outer(gain, y[k + 1] - mean[0])
            covariance = covariance - np.outer(gain, covariance[0])
        means.append(mean)
        covariances.append(covariance)
    path = [means[-1]]
    for k in range(len(predicted) - 1, -1, -1):
        transition, mean, covariance = predicted[k]
        gain = covariances[k] @ transition.T @ np.linalg.inv(covariance)
        path.append(means[k] + gain @ (path[-1] - mean))
    return np.array([path[-1][1], *(state[0] for state in path[::-1])])


def test_is_the_textbooks_smoother() -> None:
    rng = np.random.default_rng(1)
    times = clock(80)
    y = walk(80)[:, 0] + NOISE * rng.standard_normal((80, 3))
    weights = rng.choice([1.0, 0.5, 0.0], 80, p=[0.7, 0.2, 0.1])
    weights[[0, 1]] = 1.0
    step = float(np.median(np.diff(times)))
    chain = Chain.of(times, one_pass(80), np.ones(80, dtype=np.bool_), step)
    for stiffness in (0.1, 3.0, 100.0):
        expected = textbook(y, weights, times, step, stiffness)
        assert np.abs(chain.estimate(y, weights, stiffness) - expected).max() < 1e-8


def test_half_the_amplitude_is_left_at_the_cut_off() -> None:
    rate, cutoff = 100.0, 4.0
    t = np.arange(2000) / rate
    chain = Chain.of(t, one_pass(2000), np.ones(2000, dtype=np.bool_), 1.0 / rate)
    for frequency, expected in ((cutoff, 0.5), (2.0, 1.0 / (1.0 + (2.0 / 4.0) ** 4))):
        wave = np.stack([np.cos(2 * np.pi * frequency * t), np.sin(2 * np.pi * frequency * t)], axis=-1)
        out = chain.estimate(wave, np.ones(2000), chain.stiffness(cutoff))
        response = np.mean((out[500:-500] @ [1, 1j]) * np.conj(wave[500:-500] @ [1, 1j]))
        assert response == pytest.approx(expected, abs=0.003)  # real: no phase


def test_the_likelihood_finds_the_error_and_the_roughness() -> None:
    """Paths drawn from the model itself: a random walk of slopes, seen with noise."""
    rng = np.random.default_rng(2)
    step = 1.0 / 30.0
    chain = Chain.of(np.arange(3000) * step, one_pass(3000), np.ones(3000, dtype=np.bool_), step)
    for cutoff in (4.0, 6.0, 9.0):
        bends = NOISE / np.sqrt(chain.stiffness(cutoff)) * rng.standard_normal((3000, 3))
        path = np.cumsum(np.cumsum(bends, axis=0), axis=0)
        found, error = chain.likely_cutoff(path + NOISE * rng.standard_normal((3000, 3)), np.ones(3000))
        assert found == pytest.approx(cutoff, rel=0.1)
        assert error == pytest.approx(NOISE, rel=0.1)


def test_constants_and_straight_lines_stay() -> None:
    constant = np.tile(np.arange(6.0).reshape(2, 3), (50, 1, 1))
    assert np.array_equal(smoothed(constant).values, constant)
    line = constant + 1.3 * clock(50)[:, None, None]
    assert np.allclose(smoothed(line).values, line, atol=1e-9)


def test_noise_shrinks_and_motion_stays() -> None:
    truth = walk(300)
    noisy = truth + NOISE * np.random.default_rng(3).standard_normal(truth.shape)
    even = np.arange(300) / 30.0
    found = smoothed(noisy, even)
    assert np.std(found.values - truth) < 0.75 * NOISE
    quiet = smoothed(truth + 1e-4 * np.random.default_rng(3).standard_normal(truth.shape), even)
    assert np.abs(quiet.values - truth).max() < 2e-3  # little noise: next to nothing is done


def test_reversed_time_gives_the_reversed_result() -> None:
    noisy = walk(120) + NOISE * np.random.default_rng(4).standard_normal((120, 2, 3))
    times = clock(120)
    there, back = smoothed(noisy, times), smoothed(noisy[::-1], -times[::-1])
    assert np.allclose(back.values[::-1], there.values, atol=1e-9)


def test_turning_and_moving_the_axes_turns_and_moves_the_result() -> None:
    noisy = walk(120) + NOISE * np.random.default_rng(5).standard_normal((120, 2, 3))
    turn, _ = np.linalg.qr(np.random.default_rng(6).standard_normal((3, 3)))
    shift = np.array([3.0, -2.0, 5.0])
    assert np.allclose(
        smoothed(noisy @ turn + shift).values, smoothed(noisy).values @ turn + shift, atol=1e-8
    )


def test_an_inferred_value_counts_less_than_a_tracked_one_and_an_unknown_one_not_at_all() -> None:
    noisy = walk(120, 1) + NOISE * np.random.default_rng(7).standard_normal((120, 1, 3))
    moved = noisy.copy()
    moved[60, 0, 1] += 0.02
    shifts = []
    for state, unknown in ((TRACKED, False), (INFERRED, False), (TRACKED, True)):
        states, mask = np.full((120, 1), TRACKED, np.uint8), np.zeros((120, 1), dtype=np.bool_)
        states[60], mask[60] = state, unknown
        out, base = (smoothed(v, states=states, unknown=mask).values for v in (moved, noisy))
        shifts.append(abs(out[60, 0, 1] - base[60, 0, 1]))
    assert shifts[0] > 1.2 * shifts[1] > 0.0
    assert shifts[2] == 0.0


def test_a_wild_value_is_overruled_and_a_kick_is_not() -> None:
    """A minute of standing with one quick reach of half a metre, and one outlier."""
    rng = np.random.default_rng(8)
    t = np.arange(1800) / 30.0
    reach = 0.5 * np.exp(-(((t - 30.0) / 0.2) ** 2))
    truth = np.zeros((1800, 1, 3))
    truth[:, 0, 0] = reach
    noisy = truth + NOISE * rng.standard_normal(truth.shape)
    noisy[300, 0] += [0.3, 0.0, 0.0]
    found = smoothed(noisy, t)
    assert np.argwhere(found.overruled[:, 0]).ravel().tolist() == [300]
    assert np.abs(found.values[300] - truth[300]).max() < 0.02
    assert np.abs(found.values[:, 0, 0] - reach).max() < 0.04
    assert found.values[:, 0, 0].max() > 0.94 * reach.max()


def test_nothing_crosses_the_end_of_a_pass_or_a_long_gap() -> None:
    noisy = walk(90, 1) + NOISE * np.random.default_rng(9).standard_normal((90, 1, 3))
    passes = np.repeat([0, -1, 1], 30).astype(np.int32)
    far = noisy.copy()
    far[60:] += 100.0
    even = np.arange(90) / 30.0
    near, out = (smoothed(v, even, passes=passes).values for v in (noisy, far))
    assert np.allclose(out[:30], near[:30], atol=1e-6)
    assert np.allclose(out[60:], near[60:] + 100.0, atol=1e-6)
    assert np.array_equal(out[30:60], noisy[30:60])
    far[30:60] = np.nan
    gap = smoothed(far, even).values
    assert np.array_equal(np.isnan(gap), np.isnan(far))
    assert np.allclose(gap[:30], near[:30], atol=1e-6)
    assert np.allclose(gap[60:], near[60:] + 100.0, atol=1e-6)


@pytest.mark.parametrize("frames", range(1, 11))
def test_short_clips(frames: int) -> None:
    noisy = walk(frames) + 1e-3 * np.random.default_rng(frames).standard_normal((frames, 2, 3))
    out = smoothed(noisy).values
    assert np.isfinite(out).all()
    assert np.abs(out - noisy).max() < (0.03 if frames > 2 else 1e-12)
    lonely = noisy.copy()
    lonely[1::2] = np.nan  # no two frames follow each other
    assert np.array_equal(smoothed(lonely).values, lonely, equal_nan=True)


def test_a_slow_clock_and_values_without_a_spread() -> None:
    line = np.linspace(0.0, 1.0, 20)[:, None, None] * np.ones((20, 1, 3))
    found = smoothed(line, np.arange(20) / 4.0)
    assert np.allclose(found.values, line, atol=1e-9)
    assert found.cutoff[0] < MIN_CUTOFF  # of 4 Hz no more than 1.8 can be seen
    nothing = smoothed(np.full((20, 1, 3), np.nan), states=np.full((20, 1), MISSING, np.uint8))
    assert np.isnan(nothing.values).all()
    assert np.isnan(nothing.cutoff).all()


def test_the_cut_off_is_above_the_likelihoods() -> None:
    """Of paths drawn from the model with a cut-off of 5 Hz the likelihood finds it, and the error; the
    smoother's is 1.5 times as high, and a little more, since values that lost weight seem smaller errors."""
    rng = np.random.default_rng(11)
    step, frames = 1.0 / 30.0, 2000
    chain = Chain.of(np.arange(frames) * step, one_pass(frames), np.ones(frames, dtype=np.bool_), step)
    bends = NOISE / np.sqrt(chain.stiffness(5.0)) * rng.standard_normal((frames, 4, 3))
    path = np.cumsum(np.cumsum(bends, axis=0), axis=0) + NOISE * rng.standard_normal((frames, 4, 3))
    likely = np.array([chain.likely_cutoff(path[:, joint], np.ones(frames)) for joint in range(4)])
    assert likely[:, 0] == pytest.approx(5.0, rel=0.04)
    assert likely[:, 1] == pytest.approx(NOISE, rel=0.04)
    found = smoothed(path, np.arange(frames) * step).cutoff
    assert ((found > 1.5 * likely[:, 0]) & (found < 1.7 * likely[:, 0])).all()


def test_an_inferred_value_weighs_half_as_much_as_a_tracked_one() -> None:
    """A value of weight w moves its estimate by w / (w + a), where a is what its neighbours weigh."""
    even, move = np.arange(120) / 30.0, 1e-4
    noisy = walk(120, 1) + NOISE * np.random.default_rng(7).standard_normal((120, 1, 3))
    moved = noisy.copy()
    moved[60, 0, 1] += move
    shares = []
    for state in (TRACKED, INFERRED):
        states = np.full((120, 1), TRACKED, np.uint8)
        states[60] = state
        after, before = (smoothed(values, even, states).values[60, 0, 1] for values in (moved, noisy))
        shares.append((after - before) / move)
    neighbours = 1.0 / shares[0] - 1.0
    assert shares[1] * neighbours / (1.0 - shares[1]) == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize("seed", range(4))
def test_two_wild_values_in_a_row_are_overruled_and_four_are_not(seed: int) -> None:
    """Of 25 cm on a movement of 30 cm: two alone are noise, four that agree may be a movement. Of those, one
    beside the leap at most is overruled."""
    even = np.arange(150) / 30.0
    truth = 0.3 * np.sin(2 * np.pi * even[:, None, None] + np.arange(3))
    noise = NOISE * np.random.default_rng(seed).standard_normal((150, 1, 3))
    found = {}
    for burst in (2, 4):
        noisy = truth + noise
        noisy[60 : 60 + burst, 0, 0] += 0.25
        found[burst] = np.flatnonzero(smoothed(noisy, even).overruled[:, 0])
    assert found[2].tolist() == [60, 61]
    assert len(set(range(60, 64)) & set(found[4].tolist())) <= 1


def test_a_filled_gap_is_not_overruled() -> None:
    """A filled value is not a measurement, however far it is from the estimate."""
    noisy = walk(120, 1) + NOISE * np.random.default_rng(7).standard_normal((120, 1, 3))
    noisy[60, 0, 0] += 0.5
    unknown = np.zeros((120, 1), dtype=np.bool_)
    assert smoothed(noisy, unknown=unknown).overruled[60, 0]
    unknown[60] = True
    assert not smoothed(noisy, unknown=unknown).overruled.any()


@pytest.mark.parametrize("late", [1e-9, 1e-6, 1e-3])
def test_stamps_that_nearly_coincide_do_not_throw_the_path(late: float) -> None:
    """As of recorders that write a repeated time a little later."""
    times = np.arange(300) / 30.0
    stamps = times.copy()
    stamps[5::10] = stamps[4:-1:10] + late
    path = walk(300)
    noisy = path + 0.005 * np.random.default_rng(0).standard_normal(path.shape)
    found = smoothed(noisy, times=stamps).values
    assert np.abs(found - path).max() < 0.15
