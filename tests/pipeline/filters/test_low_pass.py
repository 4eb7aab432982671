"""The Butterworth filter: what it passes and stops, and that nothing crosses the end of a pass."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.filters.low_pass import CUTOFF, low_pass
from kinemimic.pipeline.kinematics.clip import Clip

Build = Callable[..., Clip]


def gain(frequency: float, rate: float, times: Array | None = None) -> complex:
    """Response of the filter at a frequency, from the middle of a long sine."""
    t = np.arange(int(20 * rate)) / rate if times is None else times
    passes = np.zeros(len(t), dtype=np.int32)
    wave = np.stack([np.cos(2 * np.pi * frequency * t), np.sin(2 * np.pi * frequency * t)], axis=-1)
    out, _ = low_pass(wave[:, None, :], t, passes)
    middle = slice(len(t) // 4, -len(t) // 4)
    return complex(np.mean((out[middle, 0] @ [1, 1j]) * np.conj(wave[middle] @ [1, 1j])))


@pytest.mark.parametrize("rate", [25.0, 30.0, 60.0, 120.0])
def test_response_is_a_fourth_order_butterworth_without_delay(rate: float) -> None:
    assert gain(CUTOFF, rate) == pytest.approx(np.sqrt(0.5), abs=2e-3)  # 3 dB, and real: no phase
    assert abs(gain(1.0, rate)) > 0.999
    # |H| = 1 / (1 + (C Ω/Ωc)^4), C² = √2 - 1, Ω = tan(π f / rate): two poles, twice.
    for frequency in (2.0, 4.0, 9.0):
        ratio = np.tan(np.pi * frequency / rate) / np.tan(np.pi * CUTOFF / rate)
        expected = 1.0 / (1.0 + (np.sqrt(2) - 1.0) * ratio**4)
        assert gain(frequency, rate) == pytest.approx(expected, abs=2e-3)


def test_an_uneven_clock_costs_little() -> None:
    rng = np.random.default_rng(0)
    times = np.cumsum(rng.choice([0.031, 0.032, 0.047], 600, p=[0.6, 0.3, 0.1]))
    for frequency in (1.0, 2.0):
        assert abs(gain(frequency, 0.0, times) - 1.0) < 0.02


def test_two_stamps_of_nearly_one_instant_do_not_throw_the_curve_off() -> None:
    times = np.arange(60) / 30.0
    times[30] = times[29] + 0.001
    still = np.zeros((60, 1, 3))
    still[30] = 0.01
    assert np.abs(low_pass(still, times, np.zeros(60, dtype=np.int32))[0]).max() < 0.011


def test_a_straight_line_stays_and_noise_shrinks(node_clip: Build) -> None:
    clip = node_clip(120)
    line = np.linspace(0, 1, 120)[:, None, None] * np.ones((120, 20, 3))
    out, _ = low_pass(line, clip.times, clip.passes)
    assert np.allclose(out, line, atol=1e-7)
    noise = np.random.default_rng(1).normal(size=(120, 20, 3))
    out, _ = low_pass(noise, clip.times, clip.passes)
    assert 0.35 < out.std() / noise.std() < 0.70  # 6 of 15 Hz are left: sqrt(0.4) of white noise


def test_nothing_crosses_the_end_of_a_pass(node_clip: Build) -> None:
    clip = node_clip(90)
    passes = np.repeat([0, -1, 1], 30).astype(np.int32)
    far = clip.positions.copy()
    far[60:] += 100.0
    near, _ = low_pass(clip.positions, clip.times, passes)
    out, _ = low_pass(far, clip.times, passes)
    assert np.array_equal(out[:30], near[:30])
    assert np.allclose(out[60:], near[60:] + 100.0)
    assert np.array_equal(out[30:60], clip.positions[30:60])


@pytest.mark.parametrize("frames", [4, 5, 9, 12])
def test_short_passes_are_filtered_without_a_fuss(node_clip: Build, frames: int) -> None:
    clip = node_clip(frames)
    out, _ = low_pass(clip.positions, clip.times, clip.passes)
    assert np.isfinite(out).all()
    assert np.abs(out - clip.positions).max() < 0.02


def test_missing_stays_missing_and_its_sides_are_filtered_apart(node_clip: Build) -> None:
    clip = node_clip(90)
    clip.positions[40:60, 3] = np.nan
    out, note = low_pass(clip.positions, clip.times, clip.passes)
    assert np.array_equal(np.isnan(out), np.isnan(clip.positions))
    alone, _ = low_pass(clip.positions[:40], clip.times[:40], clip.passes[:40])
    assert np.allclose(out[:40, 3], alone[:, 3])
    assert "4th order, 6 Hz" in note


def test_a_rate_too_low_for_the_cut_off_is_told(node_clip: Build) -> None:
    clip = node_clip(60, rate=12.0)
    out, note = low_pass(clip.positions, clip.times, clip.passes)
    assert note == "not filtered: 12 frames a second are too few for 6 Hz"
    assert np.array_equal(out, clip.positions)


def test_single_frames_are_told(node_clip: Build) -> None:
    clip = node_clip(2)
    out, note = low_pass(clip.positions, clip.times, np.array([0, 1], dtype=np.int32))
    assert note == "not filtered: single frames"
    assert np.array_equal(out, clip.positions)
