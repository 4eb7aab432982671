"""Cleaning: every filter on positions, channels and recorded quaternions, and its description."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.filters.clean import FILTER_DESCRIPTIONS, clean
from kinemimic.pipeline.filters.fill import fill_gaps
from kinemimic.pipeline.filters.options import FILTERS
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.euler import rotations_of_channels, world_positions
from kinemimic.pipeline.kinematics.rotations import (
    Y_UP_TO_Z_UP,
    angle_between,
    continuous,
    from_axis_angle,
    from_euler,
    from_rotvec,
    multiply,
    normalize,
    rotate,
)

Build = Callable[..., Clip]
FILTERING = tuple(method for method in FILTERS if method != "none")


def gappy(node_clip: Build) -> Clip:
    """Ninety frames with a short gap in joint 2, a long one in joint 4, and a spike in joint 7."""
    clip = node_clip(90)
    for joint, gap in {2: slice(40, 43), 4: slice(40, 60)}.items():
        clip.positions[gap, joint] = np.nan
        clip.states[gap, joint] = 0
    clip.positions[30, 7] += [0.0, 0.3, 0.0]
    return clip


@pytest.mark.parametrize("method", FILTERS)
def test_short_gaps_are_filled_and_marked_and_long_ones_stay(node_clip: Build, method: str) -> None:
    clip = gappy(node_clip)
    cleaned, cleaning = clean(clip, method)
    filled = fill_gaps(clip.positions, clip.times, clip.passes)[1]
    assert np.array_equal(cleaning.filled, filled)
    assert filled.sum() == 3
    assert (cleaned.states[filled] == 1).all()
    assert (cleaned.states[~filled] == clip.states[~filled]).all()
    assert np.array_equal(np.isnan(cleaned.positions).any(axis=-1), cleaned.states == 0)
    assert cleaning.done[0] == "gaps up to 0.2 s filled: 3 joint positions"
    assert np.nanmax(np.abs(cleaned.positions - node_clip(90).positions)[filled]) < 0.005


def test_each_method_says_what_it_did(node_clip: Build) -> None:
    done = {method: clean(gappy(node_clip), method)[1].done[1:] for method in FILTERS}
    assert done["none"] == ()
    assert done["butterworth"] == (
        "spikes replaced by the median of five frames: 1 joint positions",
        FILTER_DESCRIPTIONS["butterworth"],
    )
    assert done["one-euro"][1] == FILTER_DESCRIPTIONS["one-euro"]
    assert done["kalman"][0] == "outliers rejected: 1 joint positions"
    assert done["kalman"][1].startswith("Kalman-RTS smoother, cut-offs ")


def test_a_spike_is_found_by_the_smoother_and_by_the_median(node_clip: Build) -> None:
    for method in ("kalman", "butterworth"):
        cleaned, cleaning = clean(gappy(node_clip), method)
        assert np.argwhere(cleaning.spikes).tolist() == [[30, 7]]
        assert np.abs(cleaned.positions[30, 7] - node_clip(90).positions[30, 7]).max() < 0.02


@pytest.mark.parametrize("method", FILTERS)
@pytest.mark.parametrize("frames", range(1, 11))
def test_short_clips(node_clip: Build, method: str, frames: int) -> None:
    clip = node_clip(frames)
    clip.positions[0, 3], clip.states[0, 3] = np.nan, 0
    for passes in (clip.passes, np.full(frames, -1, dtype=np.int32)):
        cleaned, _ = clean(replace(clip, passes=passes), method)
        assert np.array_equal(np.isnan(cleaned.positions), np.isnan(clip.positions))
        assert np.nanmax(np.abs(cleaned.positions - clip.positions), initial=0.0) < 0.02


@pytest.mark.parametrize("method", FILTERS)
def test_nothing_crosses_the_end_of_a_pass(node_clip: Build, method: str) -> None:
    passes = np.repeat([0, -1, 1], 30).astype(np.int32)
    clip = replace(node_clip(90), passes=passes)
    far = replace(clip, positions=clip.positions + np.where(np.arange(90) < 60, 0.0, 9.0)[:, None, None])
    near, out = (clean(c, method)[0].positions for c in (clip, far))
    assert np.allclose(out[:30], near[:30], atol=1e-6)
    assert np.allclose(out[60:], near[60:] + 9.0, atol=1e-6)
    assert np.array_equal(out[30:60], clip.positions[30:60])


def test_an_unknown_method_is_refused_with_the_names(node_clip: Build) -> None:
    with pytest.raises(KinemimicError, match="kalman, butterworth, one-euro, none, found 'median'"):
        clean(node_clip(5), "median")


def rotating(node_clip: Build, frames: int) -> Clip:
    """The nodes as a capture of rotations whose root makes three full turns."""
    clip = node_clip(frames)
    euler = 0.3 * np.sin(0.15 * np.arange(frames)[:, None, None] + np.arange(60).reshape(20, 3))
    euler[:, 0, 0] = np.linspace(0, 6 * np.pi, frames)
    euler[:, 0, 1:] = 0.0
    translations = np.tile(np.full((20, 3), 0.1), (frames, 1, 1))
    orders = ("YZX",) * 20
    rotations = rotations_of_channels(euler, orders, Y_UP_TO_Z_UP)
    positions = world_positions(clip.skeleton, translations, rotations, Y_UP_TO_Z_UP)
    return replace(
        clip, positions=positions, euler=euler, orders=orders, translations=translations,
        world_from_file=Y_UP_TO_Z_UP.copy(),
    )  # fmt: skip


def test_rotations_are_left_alone_unless_asked(node_clip: Build) -> None:
    clip = rotating(node_clip, 120)
    same, cleaning = clean(clip, "none")
    assert same is clip
    assert cleaning.done == ("rotations as recorded, not filtered",)


@pytest.mark.parametrize("method", ["kalman", "butterworth"])
def test_filtered_rotations_follow_full_turns_and_lose_noise(node_clip: Build, method: str) -> None:
    clip = rotating(node_clip, 240)
    assert clip.euler is not None and clip.orders is not None
    noisy = replace(clip, euler=clip.euler + np.random.default_rng(0).normal(0, 0.05, clip.euler.shape))
    filtered, _ = clean(noisy, method)
    assert filtered.rotations is not None and filtered.euler is noisy.euler
    truth = rotations_of_channels(clip.euler, clip.orders, clip.world_from_file)
    before = angle_between(rotations_of_channels(noisy.euler, clip.orders, clip.world_from_file), truth)
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


@pytest.mark.parametrize("method", FILTERING)
def test_recorded_quaternions_are_cleaned_with_the_positions(node_clip: Build, method: str) -> None:
    clip = node_clip(120)
    rng = np.random.default_rng(3)
    truth = from_axis_angle("Z", 0.05 * np.arange(120)[:, None] * np.ones(20))
    noisy = multiply(truth, from_rotvec(0.05 * rng.standard_normal((120, 20, 3))))
    noisy[40:60, 3] = np.nan
    noisy[80:83, 5] = np.nan
    recorded = replace(clip, rotations=continuous(noisy))
    filtered = clean(recorded, method)[0].rotations
    assert filtered is not None
    assert np.argwhere(np.isnan(filtered).any(axis=(0, 2))).ravel().tolist() == [3]
    assert np.isnan(filtered[40:60, 3]).all()
    assert np.nanmax(np.abs(np.linalg.norm(filtered, axis=-1) - 1.0)) < 1e-12
    errors = [np.nanmean(angle_between(turns, truth)) for turns in (noisy, filtered)]
    assert errors[1] < (0.9 if method == "one-euro" else 0.75) * errors[0]  # it is late


@pytest.mark.parametrize("method", FILTERING)
def test_the_sign_of_a_recorded_quaternion_does_not_matter(node_clip: Build, method: str) -> None:
    """As after a repair that exchanged the sides in some frames."""
    clip = node_clip(60)
    turns = from_axis_angle("Z", 0.05 * np.arange(60)[:, None] * np.ones(20))
    flipped = turns.copy()
    flipped[20:35] *= -1.0
    same, other = (clean(replace(clip, rotations=q), method)[0].rotations for q in (turns, flipped))
    assert same is not None and other is not None
    assert angle_between(same, other).max() < 1e-7


def test_recorded_quaternions_stay_unless_a_gap_is_to_be_filled(node_clip: Build) -> None:
    turns = from_axis_angle("Z", 0.05 * np.arange(60)[:, None] * np.ones(20))
    recorded = replace(node_clip(60), rotations=turns)
    assert clean(recorded, "none")[0].rotations is turns
    gap = turns.copy()
    gap[20:23, 4] = np.nan
    filled = clean(replace(recorded, rotations=gap), "none")[0].rotations
    assert filled is not None and angle_between(filled, turns).max() < 1e-3


def test_filtered_rotations_are_sign_continuous_however_they_tumble(node_clip: Build) -> None:
    tumbling = normalize(np.random.default_rng(1).standard_normal((60, 20, 4)))
    filtered = clean(replace(node_clip(60), rotations=tumbling), "one-euro")[0].rotations
    assert filtered is not None
    assert (np.sum(filtered[1:] * filtered[:-1], axis=-1) >= 0.0).all()
