"""Strides are judged one by one: a bad one is left out, the others stay."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from samples.bouts import bouts_of
from samples.mirror import MIRROR
from samples.walker import in_place, walker

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.locomotion.bouts import Bout
from kinemimic.pipeline.locomotion.strides import PERIODS, Stride

PERIOD = 1.1


def during(bout: Bout, clip: Clip, start: float, end: float) -> list[Stride]:
    """The strides that take place within times, in seconds."""
    return [one for one in bout.strides if one.times[0] < end and one.times[1] > start]


def sensor(seconds: float = 12.0, **options: float) -> Clip:
    """A walk as a depth sensor sees it."""
    return walker(seconds=seconds, rate=30.0, noise=0.01, **options).clip  # type: ignore[arg-type]


def test_a_stride_with_garbage_in_the_middle_is_left_out_and_the_others_stay() -> None:
    clip = sensor()
    broken = (clip.times > 5.6) & (clip.times < 6.2)
    p = clip.positions.copy()
    p[broken] += 0.4 * np.random.default_rng(1).standard_normal(p[broken].shape)
    found = bouts_of(replace(clip, positions=p))
    strides = [one for bout in found for one in bout.strides]
    hit = [one for one in strides if one.times[0] < 5.9 < one.times[1]]
    assert not any(any(one.used) for one in hit)
    good = [one for one in strides if one.times[1] < 4.6 or one.times[0] > 7.2]
    assert len(good) >= 7 and all(all(one.used) for one in good)
    for bout in found:
        assert bout.period == pytest.approx(PERIOD, rel=0.02)


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_guessed_leg_is_left_out_on_its_side_only(side: str) -> None:
    clip = sensor()
    p = clip.positions.copy()
    guessed = clip.times < 5.0
    # The knee wanders, as where a sensor guesses a hidden leg; the ankles still alternate.
    wander = np.cumsum(np.random.default_rng(2).standard_normal((int(guessed.sum()), 3)), axis=0)
    wander *= 0.12 / np.abs(wander).max()
    t = clip.times[guessed]
    wander[:, 0] += 0.12 * np.sin(2.0 * np.pi * t / 0.47)
    p[guessed, N[f"knee_{side}"]] += wander
    (one,) = bouts_of(replace(clip, positions=p))
    this, other = (0, 1) if side == "left" else (1, 0)
    early, late = during(one, clip, 0.5, 4.0), [s for s in one.strides if s.times[0] > 5.5]
    assert len(early) >= 3 and len(late) >= 4
    assert not any(stride.used[this] for stride in early)
    assert all(stride.used[other] for stride in early)
    assert all(all(stride.used) for stride in late)
    assert all(stride.reason for stride in early)


def test_a_leg_that_is_not_seen_is_left_out_on_its_side_only() -> None:
    clip = sensor()
    p, hidden = clip.positions.copy(), (clip.times > 4.0) & (clip.times < 7.0)
    p[np.ix_(np.flatnonzero(hidden), [N["knee_left"]])] = np.nan
    (one,) = bouts_of(replace(clip, positions=p))
    inside = [s for s in one.strides if s.times[0] > 4.0 and s.times[1] < 7.0]
    assert inside and all(stride.used == (False, True) for stride in inside)
    outside = [s for s in one.strides if s.times[1] < 3.9 or s.times[0] > 7.1]
    assert len(outside) >= 6 and all(all(stride.used) for stride in outside)


@pytest.mark.parametrize("period", [0.6, 2.1, 2.8])
def test_quick_and_slow_strides_are_found(period: float) -> None:
    """A stride of 2.1 s is a patient's at 0.5 m/s."""
    assert PERIODS[0] < period < PERIODS[1]
    w = walker(seconds=8.0 * period, period=period, rate=30.0, noise=0.01)
    (one,) = bouts_of(w.clip)
    assert one.period == pytest.approx(period, rel=0.01) and one.cycles == pytest.approx(8.0, abs=0.3)
    assert one.speed == pytest.approx(w.speed, rel=0.03)
    assert one.used_strides > 7.0


def test_a_stride_much_longer_than_the_others_is_not_used() -> None:
    """The walker hesitates half-way for half a second."""
    clip = sensor()
    times = clip.times + 0.5 * np.clip((clip.times - 5.8) / 0.3, 0.0, 1.0)
    found = bouts_of(replace(clip, times=times))
    strides = [one for bout in found for one in bout.strides]
    (slow,) = [one for one in strides if one.times[0] < 6.2 < one.times[1]]
    assert not any(slow.used) and slow.reason
    assert sum(all(one.used) for one in strides) >= 8


def test_legs_exchanged_for_a_stride_are_not_used() -> None:
    clip = sensor(20.0)
    p = clip.positions.copy()
    p[200:233] = p[200:233][:, MIRROR]
    found = bouts_of(replace(clip, positions=p))
    strides = [one for bout in found for one in bout.strides]
    during = [s for s in strides if s.times[0] < 7.0 and s.times[1] > 7.5]
    assert not any(all(one.used) for one in during)
    assert sum(one.cycles for one in strides if all(one.used)) > 12.0


def test_feet_that_never_pass_each_other_do_not_walk() -> None:
    """The left foot is always the one ahead: twice the frequency of a stride."""
    clip = walker(seconds=6.0).clip
    p = clip.positions.copy()
    behind = p[:, N["ankle_left"], 0] < p[:, N["ankle_right"], 0]
    p[behind] = p[behind][:, MIRROR]
    assert bouts_of(replace(clip, positions=p)) == []


def test_strides_tile_a_bout_and_parts_at_its_edges_count_as_parts() -> None:
    (one,) = bouts_of(in_place(walker(seconds=6.0).clip))
    for before, after in zip(one.strides, one.strides[1:], strict=False):
        assert after.start == before.end
    assert sum(stride.cycles for stride in one.strides) == pytest.approx(6.0 / PERIOD, abs=0.1)
    assert all(stride.cycles == pytest.approx(1.0) for stride in one.strides[1:-1])
