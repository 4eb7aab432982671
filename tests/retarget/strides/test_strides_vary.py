"""Walks whose strides vary in duration: their loop is the common stride."""

from __future__ import annotations

import numpy as np
import pytest
from samples.bouts import bouts_of
from samples.walker import walker

from kinemimic.pipeline.convert import convert, on_nodes, read_converted
from kinemimic.pipeline.gait.curve_metrics import r2
from kinemimic.pipeline.ingest import ingest
from kinemimic.pipeline.kinematics.angles import ANGLES
from kinemimic.retarget.captured_angles import PassSpan
from kinemimic.retarget.cyclic import CyclicFit, fit_cyclic
from kinemimic.retarget.humanoid.motion import angles_at, joint_angles
from kinemimic.retarget.strides.selection import select_bouts


def scores(fit: CyclicFit) -> list[float]:
    at = angles_at(fit.motion, fit.strides.phase)
    return [r2(fit.captured[name], at[name]) for name in ANGLES]


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_loop_of_a_minute_of_strides_that_vary_by_two_per_cent(seed):
    w = walker(seconds=60.0, vary=0.02, seed=seed)
    (one,) = bouts_of(w.clip)
    assert one.period == pytest.approx(w.period, rel=0.01)
    assert one.used_strides == pytest.approx(60.0 / w.period, rel=0.03)
    fit = fit_cyclic(w.clip, [one], False)
    truth = w.curves(np.arange(200) / 200.0)
    for side in ("left", "right"):
        curve, known = joint_angles(fit.motion.rotations)[f"knee_{side}"], truth[f"knee_{side}"]
        assert np.degrees(curve.max()) == pytest.approx(np.degrees(known.max()), abs=1.0)
        assert np.degrees(curve.min()) == pytest.approx(np.degrees(known.min()), abs=1.0)
    assert min(scores(fit)) > 0.95
    assert fit.loop.speed == pytest.approx(w.speed, rel=0.02)


def test_varying_strides_are_timed_individually():
    (one,) = bouts_of(walker(seconds=60.0, vary=0.03).clip)
    periods = np.array([stride.period for stride in one.strides[1:-1]])
    assert np.std(periods) / np.mean(periods) == pytest.approx(0.03, abs=0.01)
    assert min(stride.r2 for stride in one.strides) > 0.98


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_an_even_walk_keeps_one_period(noise):
    w = walker(seconds=30.0, rate=30.0, limp=10.0, noise=noise)
    (one,) = bouts_of(w.clip)
    rate = np.diff(one.phase) / np.diff(w.clip.times[one.frames])
    assert rate == pytest.approx(np.full(len(rate), 1.0 / w.period), rel=0.01)


def test_an_accelerating_walk_gets_the_median_stride():
    w = walker(seconds=40.0, rate=30.0, faster=1.4, noise=0.02)
    chosen = select_bouts(bouts_of(w.clip)).bouts
    (one,) = chosen
    assert one.period == pytest.approx(w.period / 1.2, rel=0.03)
    fit = fit_cyclic(w.clip, chosen, False)
    # The walker's strides are as long as ever.
    assert fit.loop.speed == pytest.approx(1.2 * w.speed, rel=0.03)


def test_captured_frames_have_the_phase_of_their_own_stride():
    w = walker(seconds=40.0, faster=1.4)
    (one,) = bouts_of(w.clip)
    times = w.clip.times[one.frames]
    found = PassSpan(one.pass_number, times, one.turn, one.phase).at(times)[1]
    assert np.abs(found - one.phase).max() < 1e-9
    assert np.ptp(found) == pytest.approx(1.2 * 40.0 / w.period, rel=0.01)


def test_a_real_person_on_an_accelerating_treadmill(captures, tmp_path):
    """Each ankle is farthest ahead 74 times; strides take 0.74 s at first and 0.55 in the end."""
    ingest(captures / "kinect1_treadmill_c3d/skeleton_3d_19h58m42.c3d", tmp_path)
    convert(tmp_path)
    bouts = bouts_of(on_nodes(read_converted(tmp_path)))
    longest = max(bouts, key=lambda one: one.cycles)
    assert longest.pass_number == 0 and longest.path.source == "feet"
    assert 120.0 / longest.period == pytest.approx(181.0, abs=3.0)
    assert sum(one.cycles for one in bouts if one.pass_number == 0) == pytest.approx(74.0, abs=1.0)
    assert select_bouts(bouts).bouts
