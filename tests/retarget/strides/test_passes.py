from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from kinemimic.pipeline.convert import on_nodes
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import from_axis_angle, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.locomotion.harmonic import walking_direction
from kinemimic.pipeline.readers.mocap.deepmimic import read_deepmimic, stock_motion
from kinemimic.retarget.strides import passes as module
from kinemimic.retarget.strides.passes import analyze_passes, brevity_note, is_gait
from kinemimic.retarget.strides.trim import best_window, leg_bones


@pytest.mark.parametrize(
    ("bad", "start", "stop"),
    [
        ("11000000111", 2, 8),
        ("00000", 0, 5),
        ("0000100000000", 0, 13),  # one bad frame costs three: dearer than the four before it
        ("0010000000", 3, 10),
        ("111", 0, 0),
    ],
)
def test_best_window(bad, start, stop):
    window = best_window(np.array([c == "1" for c in bad]))
    assert window.stop - window.start == stop - start
    if stop > start:
        assert (window.start, window.stop) == (start, stop)


def test_walking_direction_along_a_path_and_in_place(walker):
    clip = walker(heading=-0.7).clip
    assert walking_direction(clip.positions) == (pytest.approx(-0.7, abs=0.02), True)
    still = clip.positions - (clip.positions[:, :1] - clip.positions[:1, :1])
    heading, on_path = walking_direction(still)
    assert heading == pytest.approx(-0.7, abs=0.05) and not on_path


def test_bones_of_the_walker(walker):
    w = walker(size=1.1)
    assert leg_bones(w.clip.positions) == pytest.approx(1.1 * np.tile([0.40, 0.38], (len(w.clip.times), 2)))


def test_passes_are_judged_one_by_one(walker):
    clip = walker(passes=4, seconds=2.4).clip
    p = clip.positions.copy()
    second = clip.passes == 1
    rng = np.random.default_rng(0)
    p[second] += 0.3 * rng.standard_normal(p[second].shape)
    broken = type(clip)(clip.skeleton, clip.times, p, clip.states, clip.passes)
    passes = analyze_passes(broken)
    assert [one.verdict for one in passes] == ["accepted", "refused", "accepted", "accepted"]
    assert passes[1].reason


def test_walking_backward_is_refused(walker):
    clip = walker().clip
    # The same poses in reverse: the person goes backward, facing +X.
    reverse = type(clip)(clip.skeleton, clip.times, clip.positions[::-1].copy(), clip.states, clip.passes)
    (one,) = analyze_passes(reverse)
    assert one.verdict == "refused" and "backward" in one.reason


def as_clip(clip, positions):
    return type(clip)(clip.skeleton, clip.times, positions, clip.states, clip.passes)


def test_hopping_is_not_walking(walker):
    clip = walker().clip
    assert is_gait(analyze_passes(clip))
    p = clip.positions.copy()
    # Both legs do as the left one: a hop.
    for joint in ("knee", "ankle", "foot"):
        left, right = N[f"{joint}_left"], N[f"{joint}_right"]
        p[:, right] = p[:, left] + p[:, [N["hip_right"]]][:, 0] - p[:, N["hip_left"]]
    hop = analyze_passes(as_clip(clip, p))
    assert hop[0].travel > 2.0 and not is_gait(hop)


def test_a_somersault_is_not_walking(walker):
    clip = walker().clip
    middle = clip.positions[:, :1]
    turn = from_axis_angle("Y", np.linspace(0.0, 2.0 * np.pi, len(clip.times)))[:, None]
    assert not is_gait(analyze_passes(as_clip(clip, middle + rotate(turn, clip.positions - middle))))


def test_one_cycle_in_place_is_too_brief(walker):
    w = walker(seconds=1.1)
    still = w.clip.positions - (w.clip.positions[:, :1] - w.clip.positions[:1, :1])
    (one,) = analyze_passes(as_clip(w.clip, still))
    assert one.steps and not one.walks
    assert "1.0 strides (1.1 s)" in brevity_note(one) and "more than 2" in brevity_note(one)
    (long,) = analyze_passes(walker().clip)
    assert long.walks and brevity_note(long) == ""


def test_two_steps_within_long_standing_are_no_gait(walker):
    clip = walker(seconds=6.0).clip
    p = clip.positions.copy()
    t = clip.times
    begin, end = np.searchsorted(t, [2.0, 3.2])
    p[:begin] = p[begin]
    p[end:] = p[end]
    assert not is_gait(analyze_passes(as_clip(clip, p)))


@pytest.mark.parametrize("name", ["walk", "run"])
def test_stock_gaits_are_gaits(name):
    clip = on_nodes(read_deepmimic(stock_motion(name)))
    assert is_gait(analyze_passes(clip))


@pytest.mark.parametrize(
    "name", ["jump", "kick", "punch", "spin", "spinkick", "cartwheel", "roll", "dance_a"]
)
def test_other_stock_motions_are_none(name):
    clip = on_nodes(read_deepmimic(stock_motion(name)))
    assert not is_gait(analyze_passes(clip))


def with_shaken_start(clip: Clip, frames: int, amplitude: float, seed: int) -> Clip:
    """Noise on knees and ankles that fades over the first frames, amplitude in metres."""
    rng = np.random.default_rng(seed)
    p = clip.positions.copy()
    fade = np.linspace(1.0, 0.0, frames)[:, None]
    for joint in ("knee", "ankle"):
        for side in ("left", "right"):
            p[:frames, N[f"{joint}_{side}"]] += amplitude * rng.standard_normal((frames, 3)) * fade
    return replace(clip, positions=p)


@pytest.mark.parametrize(
    ("seconds", "amplitude", "seed", "first"),
    [
        # The window only settles in the third round; with a minimum of 1.2 periods 11 frames would be cut.
        (1.8, 0.3, 2, 15),
        # With a minimum of 1.0 period 10 frames would be cut.
        (1.5, 0.15, 0, 7),
    ],
)
def test_trimming_takes_three_rounds_and_leaves_one_and_a_tenth_periods(
    walker, seconds, amplitude, seed, first
):
    clip = walker(seconds=seconds, rate=30.0, noise=0.01, seed=seed).clip
    (one,) = analyze_passes(with_shaken_start(clip, 18, amplitude, seed))
    assert one.verdict == "accepted"
    assert (one.frames[0], one.frames[-1]) == (first, len(clip.times) - 1)


def test_trimming_that_does_not_settle_ends_after_three_rounds(walker, monkeypatch):
    rounds = []

    def alternating(bad, price=3.0):
        rounds.append(len(bad))
        return slice(len(rounds) % 2, len(bad))

    monkeypatch.setattr(module, "best_window", alternating)
    analyze_passes(walker().clip)
    assert len(rounds) == 3


@pytest.mark.parametrize(("frames", "verdict"), [(47, "refused"), (48, "accepted")])
def test_a_pass_needs_three_quarters_of_a_stride(walker, frames, verdict):
    (one,) = analyze_passes(walker(seconds=frames / 60.0, rate=60.0, period=1.1).clip)
    assert one.verdict == verdict
    assert frames / 60.0 == pytest.approx(0.75 * one.harmonic.period, abs=1 / 60.0)
