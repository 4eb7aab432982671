"""Cleaning: what the filter passes and stops, what is filled, and that nothing crosses the end of a pass."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from kinemimic.pipeline.clean import CUTOFF, clean, despike, fill, low_pass
from kinemimic.pipeline.clip import Clip
from kinemimic.pipeline.euler import local_rotations, world_positions
from kinemimic.pipeline.rotations import (
    Y_UP_TO_Z_UP,
    angle_between,
    continuous,
    from_axis_angle,
    from_euler,
    from_rotvec,
    multiply,
    rotate,
)

Build = Callable[..., Clip]
Array = NDArray[np.float64]


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
    gap = replace(clip, passes=passes)
    gap.positions[28:32, 5] = np.nan
    assert not fill(gap)[1].any()


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
    assert "4th order, 6.0 Hz" in note


def test_a_rate_too_low_for_the_cut_off_is_told(node_clip: Build) -> None:
    clip = node_clip(60, rate=12.0)
    out, note = low_pass(clip.positions, clip.times, clip.passes)
    assert note == "not filtered: 12 frames a second are too few for 6.0 Hz"
    assert np.array_equal(out, clip.positions)


def test_gaps_up_to_a_fifth_of_a_second_are_filled_and_marked(node_clip: Build) -> None:
    clip = node_clip(90)
    whole = clip.positions.copy()
    for joint, gap in {
        2: slice(40, 41),
        3: slice(40, 46),
        4: slice(40, 47),
        5: slice(0, 3),
        6: slice(87, 90),
    }.items():
        clip.positions[gap, joint] = np.nan
        clip.states[gap, joint] = 0
    positions, filled = fill(clip)
    assert np.flatnonzero(filled[:, 2]).tolist() == [40]
    assert np.flatnonzero(filled[:, 3]).tolist() == [40, 41, 42, 43, 44, 45]
    assert not filled[:, 4:].any()  # too long, and the edges
    assert np.isnan(positions[40:47, 4]).all()
    assert np.abs(positions - whole)[filled].max() < 0.002
    cleaned, cleaning = clean(clip, butterworth=False)
    assert np.array_equal(cleaning.filled, filled)
    assert (cleaned.states[filled] == 1).all()
    assert (cleaned.states[~filled] == clip.states[~filled]).all()
    assert np.array_equal(cleaned.positions, positions, equal_nan=True)


def test_spikes_go_and_fast_motion_stays(node_clip: Build) -> None:
    clip = node_clip(90)
    clean_positions = clip.positions + np.array([4.0, 0, 0]) * clip.times[:, None, None]
    spiky = clean_positions.copy()
    spiky[30, 7] += [0.0, 0.2, 0.0]
    spiky[50:52, 9] += [0.1, 0.0, 0.1]
    out, spikes = despike(spiky, clip.passes)
    assert {tuple(map(int, at)) for at in np.argwhere(spikes)} == {(30, 7), (50, 9), (51, 9)}
    assert np.linalg.norm(out - clean_positions, axis=-1).max() < 0.3
    assert np.array_equal(out[~spikes], spiky[~spikes])
    assert not despike(clean_positions, clip.passes)[1].any()


def rotating(node_clip: Build, frames: int) -> Clip:
    """The nodes as a capture of rotations whose root makes three full turns."""
    clip = node_clip(frames)
    euler = 0.3 * np.sin(0.15 * np.arange(frames)[:, None, None] + np.arange(60).reshape(20, 3))
    euler[:, 0, 0] = np.linspace(0, 6 * np.pi, frames)
    euler[:, 0, 1:] = 0.0
    translations = np.tile(np.full((20, 3), 0.1), (frames, 1, 1))
    orders = ("YZX",) * 20
    rotations = local_rotations(euler, orders, Y_UP_TO_Z_UP)
    positions = world_positions(clip.skeleton, translations, rotations, Y_UP_TO_Z_UP)
    return replace(
        clip, positions=positions, euler=euler, orders=orders, translations=translations,
        world_from_file=Y_UP_TO_Z_UP.copy(),
    )  # fmt: skip


def test_rotations_are_left_alone_unless_asked(node_clip: Build) -> None:
    clip = rotating(node_clip, 120)
    same, cleaning = clean(clip, butterworth=False)
    assert same is clip
    assert cleaning.done == ("rotations as recorded, not filtered",)


def test_filtered_rotations_follow_full_turns_and_lose_noise(node_clip: Build) -> None:
    clip = rotating(node_clip, 240)
    assert clip.euler is not None and clip.orders is not None
    noisy = replace(clip, euler=clip.euler + np.random.default_rng(0).normal(0, 0.05, clip.euler.shape))
    filtered, _ = clean(noisy, butterworth=True)
    assert filtered.rotations is not None and filtered.euler is noisy.euler
    truth = local_rotations(clip.euler, clip.orders, clip.world_from_file)
    before = angle_between(local_rotations(noisy.euler, clip.orders, clip.world_from_file), truth)
    after = angle_between(filtered.rotations, truth)
    inner = slice(10, -10)
    assert after[inner].mean() < 0.75 * before[inner].mean()
    assert after[inner].max() < 0.2  # nowhere does it cut a turn short
    assert np.allclose(np.linalg.norm(filtered.rotations, axis=-1), 1.0)


def test_world_positions_of_a_known_chain(node_clip: Build) -> None:
    clip = rotating(node_clip, 5)
    assert clip.euler is not None
    root = from_euler(clip.euler[2, 0], "YZX")
    # The root's frame, then the file's: spine = T (p0 + R p1), with T the cyclic change of axes.
    offset = np.full(3, 0.1)
    assert np.allclose(clip.positions[2, 1], rotate(Y_UP_TO_Z_UP, offset + rotate(root, offset)))


def test_recorded_quaternions_are_filtered_with_the_positions(node_clip: Build) -> None:
    clip = node_clip(120)
    rng = np.random.default_rng(3)
    truth = from_axis_angle("Z", 0.05 * np.arange(120)[:, None] * np.ones(20))
    noisy = multiply(truth, from_rotvec(0.05 * rng.standard_normal((120, 20, 3))))
    noisy[40:60, 3] = np.nan
    recorded = replace(clip, rotations=continuous(noisy))
    assert clean(recorded, butterworth=False)[0].rotations is recorded.rotations
    filtered = clean(recorded, butterworth=True)[0].rotations
    assert filtered is not None
    assert np.array_equal(np.isnan(filtered), np.isnan(noisy))
    assert np.nanmax(np.abs(np.linalg.norm(filtered, axis=-1) - 1.0)) < 1e-12
    errors = [np.nanmean(angle_between(turns, truth)) for turns in (noisy, filtered)]
    assert errors[1] < 0.75 * errors[0]
