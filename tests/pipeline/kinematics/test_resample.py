"""Resampling: exact on known curves, never across a gap; states and times as documented."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.resample import resample
from kinemimic.pipeline.kinematics.rotations import IDENTITY, angle_between, from_axis_angle

Build = Callable[..., Clip]


def uneven(frames: int, seed: int = 0) -> Array:
    return np.arange(frames) / 30.0 + np.random.default_rng(seed).uniform(-0.005, 0.005, frames)


def test_the_step_is_exact_and_a_cubic_is_kept(node_clip: Build) -> None:
    times = uneven(50)
    clip = node_clip(50, times=times)
    cubic = lambda t: (t**3 - 2 * t**2 + t)[:, None, None] * np.ones((20, 3))  # noqa: E731
    for rate in (24.0, 30.0, 60.0, 100.0):
        even = resample(replace(clip, positions=cubic(times)), rate)
        assert np.allclose(even.times - even.times[0], np.arange(len(even.times)) / rate, atol=1e-12)
        assert even.times[0] == times[0]
        assert times[-1] - 1.0 / rate < even.times[-1] <= times[-1]
        assert np.allclose(even.positions, cubic(even.times), atol=1e-9)


def test_two_stamps_of_nearly_one_instant_do_not_throw_the_curve_off(node_clip: Build) -> None:
    """A centimetre of noise between frames a millisecond apart would be a slope of 10 m/s."""
    times = np.arange(60) / 30.0
    times[30] = times[29] + 0.001
    clip = node_clip(60, times=times)
    still = np.zeros_like(clip.positions)
    still[30] = 0.01
    assert np.abs(resample(replace(clip, positions=still), 60.0).positions).max() < 0.011


def test_an_even_clock_at_its_own_rate_stays(node_clip: Build) -> None:
    clip = node_clip(40)
    clip.states[7, 3] = 1
    same = resample(clip, 30.0)
    assert np.allclose(same.times, clip.times)
    assert np.allclose(same.positions, clip.positions, atol=1e-12)
    assert np.array_equal(same.states, clip.states)


def test_constant_spins_stay_constant_and_signs_do_not_matter(node_clip: Build) -> None:
    times = uneven(60)
    clip = node_clip(60, times=times)
    turns = from_axis_angle("Y", 7.0 * times[:, None] * np.ones(20))
    turns[::3] *= -1.0
    even = resample(replace(clip, rotations=turns), 47.0)
    assert even.rotations is not None
    assert (
        angle_between(even.rotations, from_axis_angle("Y", 7.0 * even.times[:, None] * np.ones(20))).max()
        < 1e-7
    )
    assert np.sum(even.rotations[1:] * even.rotations[:-1], axis=-1).min() > 0.9


def test_nothing_is_interpolated_in_gaps_or_between_passes(node_clip: Build) -> None:
    clip = node_clip(90)
    clip.passes[:] = np.repeat([0, -1, 1], 30)
    clip.positions[10:20, 4], clip.states[10:20, 4] = np.nan, 0
    clip.states[5, 6] = 1
    turns = np.tile(IDENTITY, (90, 20, 1))
    turns[10:20, 4] = np.nan
    even = resample(replace(clip, rotations=turns), 60.0)
    assert even.rotations is not None
    assert np.array_equal(np.unique(even.passes), [0, 1])
    assert even.times[even.passes == 0][-1] == pytest.approx(29 / 30)
    assert even.times[even.passes == 1][0] == pytest.approx(60 / 30)
    gap = (even.times > 9 / 30 + 1e-6) & (even.times < 20 / 30 - 1e-6)
    assert np.array_equal(np.isnan(even.positions[:, 4, 0]), gap)
    assert np.array_equal(np.isnan(even.rotations[:, 4, 0]), gap)
    assert np.array_equal(even.states[:, 4] == 0, gap)
    assert np.isfinite(np.delete(even.positions, 4, axis=1)).all()
    assert np.flatnonzero(even.states[:, 6] == 1).tolist() == [9, 10, 11]  # the frame and what leans on it


@pytest.mark.parametrize("frames", range(1, 6))
def test_short_passes(node_clip: Build, frames: int) -> None:
    even = resample(node_clip(frames), 60.0)
    assert len(even.times) == 2 * frames - 1
    assert np.isfinite(even.positions).all()


def test_channels_become_the_turns_and_places_of_their_curves(node_clip: Build) -> None:
    """Each joint turns evenly about Y, the first of its axes: the nodes move on circles about their parents,
    between the frames too."""

    def places(times: Array) -> Array:
        """The root moves along a line. All joints have the same turn about Y, so a bone (0.1, 0.1, 0.1) m
        below d joints has turned by d times its angle.
        """
        found = np.zeros((len(times), 20, 3))
        found[:, 0] = 0.1 + times[:, None] * [1.0, 0.5, 0.0]
        depth = np.zeros(20)
        for node, parent in enumerate(clip.skeleton.parents):
            if parent < 0:
                continue
            depth[node] = depth[parent] + 1
            angle = depth[node] * 1.5 * times
            cos, sin = np.cos(angle), np.sin(angle)
            found[:, node] = found[:, parent] + 0.1 * np.stack(
                [cos + sin, np.ones_like(cos), cos - sin], axis=1
            )
        return found

    clip = node_clip(60, times=uneven(60))
    euler = np.zeros((60, 20, 3))
    euler[..., 0] = 1.5 * clip.times[:, None]
    translations = np.full((60, 20, 3), 0.1)
    translations[:, 0] += clip.times[:, None] * [1.0, 0.5, 0.0]
    even = resample(replace(clip, euler=euler, orders=("YZX",) * 20, translations=translations), 50.0)
    assert even.euler is None and even.orders is None
    assert even.rotations is not None
    expected_turns = from_axis_angle("Y", 1.5 * even.times[:, None] * np.ones(20))
    assert angle_between(even.rotations, expected_turns).max() < 1e-7
    np.testing.assert_allclose(even.positions, places(even.times), atol=1e-9)


def test_what_cannot_be_is_refused(node_clip: Build) -> None:
    clip = node_clip(30)
    for rate in (0.0, -30.0, float("nan"), float("inf")):
        with pytest.raises(KinemimicError, match="positive frame rate"):
            resample(clip, rate)
    with pytest.raises(KinemimicError, match="a pass with a person"):
        resample(replace(clip, passes=np.full(30, -1, dtype=np.int32)), 30.0)
