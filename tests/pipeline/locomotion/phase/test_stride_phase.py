from __future__ import annotations

import numpy as np
import pytest

from kinemimic.pipeline.locomotion.phase.stride_phase import stride_phase


def test_the_phase_of_a_steady_walk_is_that_of_its_cosine():
    t = np.arange(0, 9.0, 1 / 30)
    found = stride_phase(t, 0.02 - 0.6 * np.cos(2 * np.pi * (t - 0.4) / 1.13))
    wrong = found - (t - 0.4) / 1.13
    # Whole cycles apart at most, and a frame's share of the stride.
    assert np.abs(wrong - np.round(wrong[0])).max() < 1 / 30 / 1.13


def test_it_follows_an_accelerating_walker():
    t = np.arange(0, 40.0, 1 / 30)
    truth = t / 1.3 + 0.004 * t**2
    found = stride_phase(t, -0.5 * np.cos(2 * np.pi * truth))
    assert np.ptp(found - truth) < 0.1
    steady = np.cos(2 * np.pi * np.outer(np.linspace(0.5, 2.0, 400), t))
    best = max(np.corrcoef(row, np.cos(2 * np.pi * truth))[0, 1] ** 2 for row in steady)
    assert best < 0.6


def test_a_missed_turning_point_of_one_foot_is_bridged_by_the_other():
    t = np.arange(0, 8.0, 1 / 30)
    d = -0.5 * np.cos(2 * np.pi * t)
    d[(t > 3.3) & (t < 3.7)] = np.nan
    found = stride_phase(t, d)
    assert found[-1] - found[0] == pytest.approx(t[-1] - t[0], abs=0.1)


def test_one_step_has_no_phase():
    t = np.arange(0, 1.0, 1 / 30)
    assert stride_phase(t, 0.3 * t) is None
    assert stride_phase(t[:4], t[:4]) is None


def test_a_noisy_lopsided_wave_is_timed_to_a_hundredth_of_a_cycle():
    t = np.arange(0, 40.0, 1 / 30)
    rng = np.random.default_rng(0)
    truth = t / 1.1 + 0.05 * np.sin(2 * np.pi * t / 15.0)
    d = -0.3 * np.cos(2 * np.pi * truth) + 0.03 * np.sin(4 * np.pi * truth)
    found = stride_phase(t, d + 0.02 * rng.standard_normal(len(t)))
    assert np.std(found - truth) < 0.008
