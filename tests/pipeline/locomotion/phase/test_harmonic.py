"""The harmonic of a gait: period, phase and amplitude from synthetic ankles."""

from __future__ import annotations

import numpy as np
import pytest
from samples.walker import in_place, walker

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.locomotion.phase.harmonic import fit_harmonic, walking_direction

# None of the periods that the search begins with.
PERIOD, AMPLITUDE, START, RATE = 1.1349, 0.6, 0.4, 30.0


def ankles(times: Array) -> Array:
    """Metres (T,), with a Kinect's noise, farthest apart at START."""
    noise = np.random.default_rng(0).normal(0.0, 0.02, len(times))
    return -AMPLITUDE * np.cos(2.0 * np.pi * (times - START) / PERIOD) + 0.03 + noise


@pytest.mark.parametrize("seconds", [3.0, 30.0, 60.0, 61.0, 300.0, 1200.0])
def test_period_and_phase_of_a_walk_of_any_length(seconds: float) -> None:
    times = 17.0 + np.arange(int(seconds * RATE)) / RATE
    found = fit_harmonic(times, ankles(times))
    assert found.r2 > 0.99 and found.kept > 0.97
    assert found.period == pytest.approx(PERIOD, abs=0.02 / seconds)
    assert found.amplitude == pytest.approx(AMPLITUDE, abs=0.01)
    off = found.phase(times) - (times - START) / PERIOD
    off -= np.round(off[0])
    assert np.abs(off).max() < 0.02


def test_frames_without_weight_do_not_count_wherever_they_are() -> None:
    times = np.arange(int(200 * RATE)) / RATE
    seen = (times > 130.0).astype(np.float64)
    found = fit_harmonic(times, np.where(seen > 0, ankles(times), 0.0), seen)
    assert found.period == pytest.approx(PERIOD, abs=1e-3)
    assert found.r2 > 0.99


def test_a_gap_of_years_in_the_clock_keeps_the_period() -> None:
    times = np.concatenate([np.arange(300) / RATE, 1e11 + np.arange(200) / RATE])
    assert fit_harmonic(times, ankles(times)).period == pytest.approx(PERIOD, abs=1e-3)


def test_harmonic_of_a_cosine_is_exact() -> None:
    t = np.arange(0, 2.9, 1 / 30)
    h = fit_harmonic(t, 0.02 - 0.6 * np.cos(2 * np.pi * (t - 0.4) / 1.13))
    assert h.period == pytest.approx(1.13, abs=1e-4)
    assert np.mod(h.phase(np.array([0.4]))[0] + 0.5, 1.0) == pytest.approx(0.5, abs=1e-3)
    assert h.amplitude == pytest.approx(0.6, abs=1e-4)
    assert h.r2 > 0.9999 and h.kept == 1.0


def test_the_harmonic_rejects_swapped_legs() -> None:
    t = np.arange(0, 2.9, 1 / 30)
    d = -0.6 * np.cos(2 * np.pi * (t - 0.4) / 1.13)
    swapped = d.copy()
    swapped[20:28] *= -1
    h = fit_harmonic(t, swapped)
    assert h.period == pytest.approx(1.13, abs=5e-3)
    # All but the frame where the ankles pass each other are far off.
    assert (h.weights[20:28][np.abs(d[20:28]) > 0.2] == 0).all()
    assert h.kept > 0.9


def test_noise_is_no_harmonic() -> None:
    rng = np.random.default_rng(0)
    assert fit_harmonic(np.arange(90) / 30, rng.standard_normal(90)).r2 < 0.5


def test_walking_direction_along_a_path_and_in_place() -> None:
    clip = walker(heading=-0.7).clip
    assert walking_direction(clip.positions) == pytest.approx(-0.7, abs=0.02)
    assert walking_direction(in_place(clip).positions) == pytest.approx(-0.7, abs=0.05)
