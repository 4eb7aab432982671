"""Fourier series in a phase: what is fitted comes back, and the derivative is that of the values."""

from __future__ import annotations

import numpy as np
import pytest

from kinemimic.pipeline.locomotion.phase.fourier import evaluate, fit


def test_a_series_is_the_sum_of_its_cosines_and_sines() -> None:
    """In the order 1, cos φ, cos 2φ, sin φ, sin 2φ."""
    phase = np.linspace(-1.0, 2.0, 40)
    turn = 2.0 * np.pi * phase
    expected = 3.0 + 2.0 * np.cos(turn) - np.cos(2 * turn) + 0.5 * np.sin(turn) + 4.0 * np.sin(2 * turn)
    np.testing.assert_allclose(evaluate(np.array([3.0, 2.0, -1.0, 0.5, 4.0]), phase), expected, atol=1e-12)


@pytest.mark.parametrize("harmonics", [1, 4, 8])
def test_a_fit_of_a_series_is_the_series(harmonics: int) -> None:
    """At uneven phases over several cycles, with weights, for values of any shape."""
    rng = np.random.default_rng(harmonics)
    series = rng.standard_normal((1 + 2 * harmonics, 3, 2))
    phase = rng.uniform(-2.0, 5.0, 200)
    weights = rng.uniform(0.1, 1.0, 200)
    found = fit(phase, evaluate(series, phase), harmonics, weights=weights, ridge=0.0)
    np.testing.assert_allclose(found, series, atol=1e-9)


def test_the_derivative_is_the_limit_of_differences() -> None:
    rng = np.random.default_rng(0)
    series, phase, step = rng.standard_normal((9, 2)), rng.uniform(0.0, 1.0, 30), 1e-5
    differences = (evaluate(series, phase + step) - evaluate(series, phase - step)) / (2.0 * step)
    np.testing.assert_allclose(evaluate(series, phase, 1), differences, atol=1e-5)


def test_a_sample_without_weight_does_not_count() -> None:
    phase = np.arange(50) / 50.0
    values = np.cos(2.0 * np.pi * phase)
    spoiled, weights = values.copy(), np.ones(50)
    spoiled[7], weights[7] = 99.0, 0.0
    np.testing.assert_allclose(fit(phase, spoiled, 2, weights=weights, ridge=0.0), [0, 1, 0, 0, 0], atol=1e-9)


def test_a_ridge_reduces_the_higher_harmonics_most_and_keeps_the_mean() -> None:
    """At even phases the columns are orthogonal: the k-th harmonic becomes 1 / (1 + 2 ridge k⁴) of itself."""
    phase, ridge = np.arange(64) / 64.0, 0.01
    found = fit(phase, evaluate(np.ones(7), phase), 3, ridge=ridge)
    shrunk = 1.0 / (1.0 + 2.0 * ridge * np.arange(1, 4) ** 4)
    np.testing.assert_allclose(found, [1.0, *shrunk, *shrunk], atol=1e-12)
