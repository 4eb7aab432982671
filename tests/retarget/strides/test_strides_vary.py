"""Walks whose strides vary in duration: their loop is the common stride."""

from __future__ import annotations

import numpy as np
import pytest

from kinemimic.pipeline.convert import convert, on_nodes
from kinemimic.pipeline.files.store import read_clip
from kinemimic.pipeline.ingest import ingest
from kinemimic.pipeline.kinematics.angles import ANGLES
from kinemimic.retarget.command import _stride_span
from kinemimic.retarget.cyclic import CyclicFit, fit_cyclic
from kinemimic.retarget.humanoid.motion import joint_angles
from kinemimic.retarget.report import r_squared, reference_at
from kinemimic.retarget.strides.loop import MIRROR_NODES
from kinemimic.retarget.strides.passes import analyze_passes, select_passes
from kinemimic.retarget.strides.treadmill import add_belt_travel


def scores(fit: CyclicFit) -> list[float]:
    at = reference_at(fit.motion, fit.strides.phase)
    return [r_squared(fit.captured[name], at[name]) for name in ANGLES]


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_loop_of_a_minute_of_strides_that_vary_by_two_per_cent(walker, seed):
    w = walker(seconds=60.0, vary=0.02, seed=seed)
    (one,) = analyze_passes(w.clip)
    assert one.verdict == "accepted" and one.harmonic.period == pytest.approx(w.period, rel=0.01)
    fit = fit_cyclic(w.clip, [one], False)
    truth = w.curves(np.arange(200) / 200.0)
    for side in ("left", "right"):
        curve, known = joint_angles(fit.motion.rotations)[f"knee_{side}"], truth[f"knee_{side}"]
        assert np.degrees(curve.max()) == pytest.approx(np.degrees(known.max()), abs=1.0)
        assert np.degrees(curve.min()) == pytest.approx(np.degrees(known.min()), abs=1.0)
    assert min(scores(fit)) > 0.95
    assert fit.loop.speed == pytest.approx(w.speed, rel=0.02)


def test_varying_strides_are_timed_individually(walker):
    w = walker(seconds=60.0, vary=0.02)
    (one,) = analyze_passes(w.clip)
    assert one.individually_timed and one.drift > 0.03
    assert one.harmonic.r2 > 0.99


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_an_even_walk_keeps_one_period_and_the_clock_of_the_clip(walker, noise):
    w = walker(seconds=30.0, rate=30.0, limp=10.0, noise=noise)
    (one,) = analyze_passes(w.clip)
    assert not one.individually_timed and one.drift < 0.01
    assert (one.clock == w.clip.times[one.frames]).all()


def test_an_accelerating_walk_gets_the_median_stride(walker):
    w = walker(seconds=40.0, rate=30.0, faster=1.4, noise=0.02)
    (one,) = chosen = select_passes(analyze_passes(w.clip))[0]
    assert one.individually_timed and one.harmonic.r2 > 0.95
    assert one.harmonic.period == pytest.approx(w.period / 1.2, rel=0.03)
    fit = fit_cyclic(w.clip, chosen, False)
    # The walker's strides are as long as ever.
    assert fit.loop.speed == pytest.approx(1.2 * w.speed, rel=0.03)


def test_captured_frames_have_the_phase_of_their_own_stride(walker):
    w = walker(seconds=40.0, faster=1.4)
    (one,) = analyze_passes(w.clip)
    found = _stride_span(w.clip, one).phase(w.clip.times[one.frames])
    assert np.abs(found - one.phase).max() < 1e-9
    assert one.individually_timed and np.ptp(found) == pytest.approx(1.2 * 40.0 / w.period, rel=0.01)


def test_legs_swapped_for_a_stride_are_not_varying_strides(walker):
    w = walker(seconds=20.0, rate=30.0, noise=0.01)
    p = w.clip.positions.copy()
    p[200:233] = p[200:233][:, MIRROR_NODES]
    (one,) = analyze_passes(type(w.clip)(w.clip.skeleton, w.clip.times, p, w.clip.states, w.clip.passes))
    assert not one.individually_timed


def test_a_real_runner_on_an_accelerating_treadmill(captures, tmp_path):
    """75 strides, the first of 0.74 and the last of 0.55 s: no single period fits them."""
    ingest(captures / "kinect1_treadmill_c3d/skeleton_3d_19h58m42.c3d", tmp_path)
    convert(tmp_path)
    clip, _ = add_belt_travel(on_nodes(read_clip(tmp_path / "quaternions.parquet")))
    (one,) = select_passes(analyze_passes(clip))[0]
    assert one.number == 0 and len(one.frames) > 1000 and one.individually_timed
    assert 120.0 / one.harmonic.period == pytest.approx(181.0, abs=3.0)
    assert np.ptp(one.phase) == pytest.approx(75.0, abs=1.5)
