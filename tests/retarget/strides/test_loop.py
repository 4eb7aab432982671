"""Pooled frames: the weights of states, sections and the mirror image; the sign of a mean rotation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from samples.bouts import bouts_of

from kinemimic.pipeline.kinematics.rotations import angle_between, from_axis_angle, from_rotvec, multiply
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.retarget.strides.loop import fit_root, mean_rotation, pool_strides, robust_fit, with_mirror


def test_a_tracked_joint_counts_fully_an_inferred_one_by_0_3_and_a_missing_one_not(walker):
    clip = walker().clip
    states = clip.states.copy()
    states[:, N["wrist_left"]], states[:, N["wrist_right"]] = 1, 0
    clip = replace(clip, states=states)
    strides = pool_strides(clip, bouts_of(clip))
    tracked = strides.weights[:, N["elbow_left"]]
    assert tracked.min() > 0.9
    assert strides.weights[:, N["wrist_left"]] == pytest.approx(0.3 * tracked)
    assert not strides.weights[:, N["wrist_right"]].any()


def test_a_section_counts_by_the_inverse_of_its_variance():
    """Of two sections that contradict each other, the one that scatters less decides.

    The first is 0, the second -2 or 4. A mean m leaves residuals of m, 2 + m and 4 - m, with medians of m in
    the first section and 3 in the second. The scale s is the floor of 3, so that the sections count by
    s² / (s² + 2 m²) and 9 / (9 + 18) = 1/3, and a residual r by (1 - (r / 4.685 s)²)².
    """
    phase = np.tile(np.arange(200) / 100.0, 2)
    group = np.repeat([0, 1], 200)
    scatter = np.where(group == 0, 0.0, 3.0) * np.where(np.arange(400) % 4 < 2, 1.0, -1.0)
    values = np.where(group == 0, 0.0, 1.0) + scatter
    series = robust_fit(phase, values[:, None], 2, np.ones(400), group, floor=3.0)
    mean = 0.0
    for _ in range(30):
        first, low, high = (1.0 - (np.array([mean, 2.0 + mean, 4.0 - mean]) / (4.685 * 3.0)) ** 2) ** 2
        first *= 2.0 * 9.0 / (9.0 + 2.0 * mean**2)
        mean = (-2.0 * low + 4.0 * high) / 3.0 / (first + (low + high) / 3.0)
    # Sections of equal weight would meet at 0.42.
    assert 0.15 < mean < 0.25
    assert series[0, 0] == pytest.approx(mean, abs=0.002)


def test_the_mirror_image_is_made_of_sections_of_its_own(walker):
    clip = walker(passes=2, seconds=2.4).clip
    strides = pool_strides(clip, bouts_of(clip))
    both = with_mirror(strides)
    frames = len(strides.phase)
    assert np.unique(both.group[:frames]).tolist() == [0, 1]
    assert (both.group[frames:] == strides.group + 2).all()
    assert both.phase[frames:] == pytest.approx(strides.phase + 0.5)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("axis", ["X", "Y", "Z"])
@pytest.mark.parametrize("angle", [-2.0, -0.5, 0.5, 2.0])
def test_the_mean_of_rotations_about_a_middle_is_the_middle_whatever_their_signs(axis, angle, sign):
    """For each rotation by v from the middle there is one by -v; half of all have the other sign."""
    mean = from_axis_angle(axis, angle)
    scatter = 0.3 * np.random.default_rng(0).standard_normal((25, 3))
    q = sign * multiply(mean, from_rotvec(np.concatenate([scatter, -scatter])))
    q[::2] *= -1.0
    assert np.degrees(angle_between(q, mean)).min() > 2.0
    found = mean_rotation(q, np.ones(50))
    assert found[3] > 0.0
    assert np.degrees(angle_between(found, mean)) < 1e-5


def test_rotations_without_weight_do_not_enter_the_mean():
    q = from_axis_angle("Y", np.array([0.2, 0.6, 2.5]))
    found = mean_rotation(q, np.array([1.0, 1.0, 0.0]))
    assert angle_between(found, from_axis_angle("Y", 0.4)) < 1e-7
    assert angle_between(mean_rotation(q, np.array([1.0, 1e-9, 0.0])), q[0]) < 1e-6


def test_the_end_of_a_short_bout_fades_over_into_its_beginning(walker):
    """What is seen twice counts as much as what is seen once, and changes over without a step."""
    clip = walker(passes=1, seconds=1.4).clip
    strides = pool_strides(clip, bouts_of(clip))
    phase, weight = strides.phase - strides.phase.min(), strides.weights[:, N["spine"]]
    repeated = np.ptp(phase) - 1.0
    assert 0.1 < repeated < 0.9
    assert weight[(phase > repeated) & (phase < 1.0)] == pytest.approx(1.0)
    at = np.linspace(0.1, 0.9, 5) * repeated
    assert np.interp(at, phase, weight) + np.interp(at + 1.0, phase, weight) == pytest.approx(1.0, abs=0.02)
    assert weight[0] < 0.05 and weight[-1] < 0.05


def test_a_bout_of_two_strides_and_several_bouts_count_fully(walker):
    for clip in (walker(passes=1, seconds=2.6).clip, walker(passes=2, seconds=1.4).clip):
        strides = pool_strides(clip, bouts_of(clip))
        assert strides.weights[:, N["spine"]].min() > 0.9


def test_frames_without_hips_do_not_count_for_the_root(walker):
    strides = pool_strides(clip := walker(passes=2, seconds=2.6).clip, bouts_of(clip))
    hips = [N["hip_left"], N["hip_right"]]
    lost = np.arange(10, 16)
    positions, weights = strides.positions.copy(), strides.weights.copy()
    positions[lost[:, None], hips], weights[lost[:, None], hips] = np.nan, 0.0
    positions[20, hips[0]], weights[20, hips[0]] = np.nan, 0.0
    series, speed = fit_root(replace(strides, positions=positions, weights=weights), 4)
    whole, whole_speed = fit_root(strides, 4)
    assert speed == pytest.approx(whole_speed, rel=0.02)
    assert np.abs(series - whole).max() < 0.01
