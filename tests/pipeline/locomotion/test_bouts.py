"""Bouts of walking: what is one, where it begins and ends, and how fast it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from samples.bouts import bouts_of
from samples.mirror import MIRROR
from samples.walker import along, hips, in_place, joined, standing, walker

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.convert import on_nodes
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import from_axis_angle, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.locomotion.bouts import Bout
from kinemimic.pipeline.readers.mocap.deepmimic import read_deepmimic, stock_motion
from kinemimic.pipeline.virtual_kinect.subject import close_loop


def mirrored_time(clip: Clip) -> Clip:
    """The same poses in reverse: the person steps backward."""
    return replace(clip, positions=clip.positions[::-1].copy())


def upright(seconds: float, rate: float = 60.0) -> Clip:
    """A person who stands with straight legs."""
    clip = standing(walker(rate=rate).clip, seconds)
    for side in ("left", "right"):
        hip = clip.positions[:, N[f"hip_{side}"]]
        clip.positions[:, N[f"knee_{side}"]] = hip - [0.0, 0.0, 0.44]
        clip.positions[:, N[f"ankle_{side}"]] = hip - [0.0, 0.0, 0.86]
        clip.positions[:, N[f"foot_{side}"]] = hip - [-0.12, 0.0, 0.89]
    return clip


@pytest.mark.parametrize("noise", [0.0, 0.01])
@pytest.mark.parametrize("heading", [0.0, 2.2])
def test_a_walk_has_its_period_speed_and_length(noise: float, heading: float) -> None:
    w = walker(seconds=6.0, noise=noise, heading=heading)
    (one,) = bouts_of(w.clip)
    assert one.period == pytest.approx(w.period, rel=0.01)
    assert one.speed == pytest.approx(w.speed, rel=0.01)
    assert one.cycles == pytest.approx(6.0 / w.period, abs=0.1)
    assert one.path.source == "recorded" and not one.running and not one.backward
    assert one.precise == (noise == 0.0)
    assert one.positions[-1, 0, 0] - one.positions[0, 0, 0] == pytest.approx(6.0 * w.speed, rel=0.02)
    assert np.angle(np.exp(1j * (one.heading - heading))) == pytest.approx(0.0, abs=np.radians(3.0))


def test_a_walk_down_stairs_is_no_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """There, the rear foot is in the air as in running, but nobody runs so slowly: here, below 10 m/s."""
    monkeypatch.setattr("kinemimic.pipeline.locomotion.bouts.SLOWEST_RUN", 10.0)
    (one,) = bouts_of(on_nodes(read_deepmimic(stock_motion("run"))))
    assert not one.running


@pytest.mark.parametrize("name", ["walk", "run"])
def test_stock_gaits_are_bouts(name: str) -> None:
    """Their speed is that of the closed cycle, the way of the root in a period."""
    motion = read_deepmimic(stock_motion(name))
    (one,) = bouts_of(on_nodes(motion))
    assert one.running == (name == "run")
    assert one.speed == pytest.approx(close_loop(motion).speed, rel=0.02)


@pytest.mark.parametrize(
    "name", ["jump", "kick", "punch", "spin", "spinkick", "cartwheel", "roll", "dance_a"]
)
def test_other_stock_motions_are_none(name: str) -> None:
    assert bouts_of(on_nodes(read_deepmimic(stock_motion(name)))) == []


def test_each_pass_is_judged_by_itself() -> None:
    clip = walker(passes=4, seconds=2.6).clip
    p = clip.positions.copy()
    second = clip.passes == 1
    p[second] += 0.3 * np.random.default_rng(0).standard_normal(p[second].shape)
    assert [one.pass_number for one in bouts_of(replace(clip, positions=p))] == [0, 2, 3]


def test_walking_backward_has_a_negative_speed() -> None:
    w = walker(seconds=6.0)
    (one,) = bouts_of(mirrored_time(w.clip))
    assert one.backward and one.speed == pytest.approx(-w.speed, rel=0.05)


def test_a_walk_there_and_back_is_two_bouts_or_one_whose_turn_is_left_out() -> None:
    clip = walker(seconds=10.0).clip
    t = clip.times
    yaw = np.pi * np.clip((t - 4.5) / 1.1, 0.0, 1.0)
    found = bouts_of(along(clip, yaw))
    assert 1 <= len(found) <= 2
    for one in found:
        legs = one.leg_mask().any(axis=1)
        times = t[one.frames][legs]
        assert not ((times > 4.8) & (times < 5.3)).any()
    covered = np.concatenate([t[one.frames][one.leg_mask().any(axis=1)] for one in found])
    # Both ways are used.
    assert (covered < 4.0).sum() / 60.0 > 3.0 and (covered > 6.5).sum() / 60.0 > 2.5


def test_standing_before_and_after_is_no_part_of_a_walk() -> None:
    walk = walker(seconds=6.0).clip
    clip = joined(standing(walk, 2.0), walk, standing(walk, 2.0, frame=-1))
    (one,) = bouts_of(clip)
    times = clip.times[one.frames]
    assert times[0] == pytest.approx(2.0, abs=0.6) and times[-1] == pytest.approx(8.0, abs=0.6)


def test_hopping_is_not_walking() -> None:
    clip = walker(seconds=6.0).clip
    p = clip.positions.copy()
    # Both legs do as the left one.
    for joint in ("knee", "ankle", "foot"):
        p[:, N[f"{joint}_right"]] = p[:, N[f"{joint}_left"]] + p[:, N["hip_right"]] - p[:, N["hip_left"]]
    assert bouts_of(replace(clip, positions=p)) == []


def test_a_somersault_is_not_walking() -> None:
    clip = walker().clip
    middle = clip.positions[:, :1]
    turn = from_axis_angle("Y", np.linspace(0.0, 2.0 * np.pi, len(clip.times)))[:, None]
    assert bouts_of(replace(clip, positions=middle + rotate(turn, clip.positions - middle))) == []


def swung(clip: Clip, ahead: dict[str, Array], aside: dict[str, Array], drop: Array | None = None) -> Clip:
    """A person who stands; ahead, aside: (T,) radians by which each leg swings at the hip."""
    p = clip.positions.copy()
    for side in ("left", "right"):
        hip = clip.positions[:, [N[f"hip_{side}"]]]
        turn = from_axis_angle("Y", -ahead[side])[:, None]
        out = from_axis_angle("X", aside[side])[:, None]
        nodes = [N[f"{joint}_{side}"] for joint in ("knee", "ankle", "foot")]
        p[:, nodes] = hip + rotate(out, rotate(turn, clip.positions[:, nodes] - hip))
    if drop is not None:
        p[..., 2] -= drop[:, None]
    return replace(clip, positions=p)


def test_steps_to_the_side_are_no_walk() -> None:
    clip = upright(6.0)
    wave = np.sin(2.0 * np.pi * clip.times / 1.1)
    none = np.zeros(len(wave))
    apart = 0.25 * (0.5 + 0.5 * wave)
    legs = swung(clip, {"left": none, "right": none}, {"left": apart, "right": -apart})
    legs.positions[..., 1] += 0.5 * clip.times[:, None]
    assert bouts_of(legs) == []


def test_a_kick_is_no_walk() -> None:
    clip = upright(3.0)
    kick = 1.0 * np.exp(-(((clip.times - 1.5) / 0.25) ** 2))
    none = np.zeros(len(kick))
    assert bouts_of(swung(clip, {"left": kick, "right": none}, {"left": none, "right": none})) == []


def test_kicks_of_one_leg_in_place_are_no_walk() -> None:
    clip = upright(6.0)
    kick = 0.5 * np.sin(2.0 * np.pi * clip.times / 1.1)
    none = np.zeros(len(kick))
    assert bouts_of(swung(clip, {"left": kick, "right": none}, {"left": none, "right": none})) == []


def test_squats_and_jumps_are_no_walk() -> None:
    clip = upright(6.0)
    low = 0.2 * (1.0 - np.cos(2.0 * np.pi * clip.times / 1.5))
    squat = clip.positions.copy()
    above = [k for name, k in N.items() if not name.startswith(("ankle", "foot"))]
    squat[:, above, 2] -= low[:, None]
    for side in ("left", "right"):
        squat[:, N[f"knee_{side}"], 0] += 0.8 * low
    assert bouts_of(replace(clip, positions=squat)) == []
    leap = replace(clip, positions=clip.positions + np.abs(low)[:, None, None] * [0.0, 0.0, 1.0])
    assert bouts_of(leap) == []


def test_a_part_of_a_stride_in_place_is_too_brief() -> None:
    assert bouts_of(in_place(walker(seconds=0.7).clip)) == []
    assert len(bouts_of(in_place(walker(seconds=3.3).clip))) == 1


def test_two_steps_within_long_standing_are_no_walk() -> None:
    clip = walker(seconds=6.0).clip
    p = clip.positions.copy()
    begin, end = np.searchsorted(clip.times, [2.0, 3.2])
    p[:begin] = p[begin]
    p[end:] = p[end]
    assert bouts_of(replace(clip, positions=p)) == []


@pytest.mark.parametrize(("seconds", "found"), [(0.70, 0), (0.90, 1)])
def test_a_walker_who_crosses_the_view_shows_three_quarters_of_a_stride(seconds: float, found: int) -> None:
    assert len(bouts_of(walker(seconds=seconds).clip)) == found


def test_a_curve_is_straightened_in_walking_axes() -> None:
    w = walker(seconds=8.0)
    clip = along(w.clip, 0.25 * w.clip.times)
    (one,) = bouts_of(clip)
    # The heading is averaged over half a second: at either end it lags the turn by 2 degrees.
    assert np.ptp(one.heading) == pytest.approx(0.25 * 8.0, abs=0.1)
    assert one.speed == pytest.approx(w.speed, rel=0.02)
    path = hips(one.positions)[:, 0]
    assert np.ptp(path[:, 0]) == pytest.approx(8.0 * w.speed, rel=0.02)
    assert np.ptp(path[:, 1]) < 0.015 * np.ptp(path[:, 0])


def limping_walks() -> Clip:
    """Two walks of one pass, the first on a curve, with standing between them; the left ankle is lost for a
    third of a stride."""
    walk = walker(seconds=6.0, limp=15.0, noise=0.004).clip
    clip = joined(along(walk, 0.2 * walk.times), standing(walk, 2.0, frame=-1), walk)
    first, _ = bouts_of(clip)
    # Within one stride, whether strides are cut at the left foot or half a cycle later at the right one.
    clip.positions[first.frames[(first.phase > 3.1) & (first.phase < 3.45)], N["ankle_left"]] = np.nan
    return clip


def facts(one: Bout) -> Array:
    """Of a bout: speed, period, phases and times of its strides, and their turns."""
    strides = [[s.start, s.end, *s.times, s.turn] for s in one.strides]
    return np.array([one.speed, one.period, *np.ravel(strides)])


def test_the_mirror_image_has_the_same_bouts_with_the_legs_exchanged() -> None:
    """A phase counts from the left ankle, so it is half a cycle later; turns go the other way."""
    clip = limping_walks()
    image = replace(clip, positions=clip.positions[:, MIRROR] * [1.0, -1.0, 1.0])
    was, found = bouts_of(clip), bouts_of(image)
    assert len(was) == len(found) == 2
    for one, mirrored in zip(was, found, strict=True):
        assert mirrored.speed == pytest.approx(one.speed, rel=0.01)
        assert mirrored.period == pytest.approx(one.period, rel=0.01)
        assert np.abs(mirrored.frames[[0, -1]] - one.frames[[0, -1]]).max() <= 2
        same = np.intersect1d(one.frames, mirrored.frames)
        phases = [b.phase[np.searchsorted(b.frames, same)] for b in (one, mirrored)]
        off = np.mod(phases[1] - phases[0], 1.0)
        np.testing.assert_allclose(off, 0.5, atol=0.02)
        headings = [b.heading[np.searchsorted(b.frames, same)] for b in (one, mirrored)]
        np.testing.assert_allclose(np.sin(headings[0] + headings[1]), 0.0, atol=0.02)
    bad = [
        [s for one in bouts for s in one.strides if s.walking and not all(s.used)] for bouts in (was, found)
    ]
    assert [[s.used for s in strides] for strides in bad] == [[(False, True)], [(True, False)]]
    lost = clip.times[np.isnan(clip.positions[:, N["ankle_left"], 0])]
    for ((begin, end),) in ([s.times for s in strides] for strides in bad):
        assert begin < lost[0] and lost[-1] < end


@pytest.mark.parametrize(("later", "shift"), [(0.0, (5.0, -3.0)), (1000.0, (0.0, 0.0))])
def test_neither_the_origin_of_the_clock_nor_the_place_changes_a_bout(
    later: float, shift: tuple[float, float]
) -> None:
    clip = limping_walks()
    moved = replace(clip, times=clip.times + later, positions=clip.positions + np.array([*shift, 0.0]))
    was, found = bouts_of(clip), bouts_of(moved)
    assert len(was) == len(found) == 2
    for one, other in zip(was, found, strict=True):
        np.testing.assert_array_equal(other.frames, one.frames)
        expected = facts(one)
        expected[2:].reshape(-1, 5)[:, 2:4] += later
        np.testing.assert_allclose(facts(other), expected, atol=1e-6)
        np.testing.assert_allclose(other.positions, one.positions, atol=1e-6)
        assert [s.used for s in other.strides] == [s.used for s in one.strides]
