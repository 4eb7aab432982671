"""The gait loop of a synthetic walker against its true angles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from samples.bouts import bouts_of
from samples.mirror import MIRROR
from samples.other_steps import stepping
from samples.walker import changing_bones, hips, stand_walk_stand, swaying
from scipy.special import i0e

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import angle_between, from_axis_angle, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.retarget.cyclic import LEG_HARMONICS, CyclicFit, fit_cyclic
from kinemimic.retarget.feet.contact import at_lowest_corner, corner_velocity, sole_positions
from kinemimic.retarget.feet.ground import measure_path
from kinemimic.retarget.feet.scale import stance_width
from kinemimic.retarget.humanoid.motion import joint_angles
from kinemimic.retarget.noncyclic import fit_noncyclic
from kinemimic.retarget.optimise.refine import refine
from kinemimic.retarget.report import noncyclic_report
from kinemimic.retarget.strides.asymmetry import asymmetry_and_noise
from kinemimic.retarget.strides.excerpt import excerpt_of_bout, excerpt_of_pass
from kinemimic.retarget.strides.selection import select_bouts


def loop_of(clip: Clip, symmetric: bool | None = None) -> CyclicFit:
    return fit_cyclic(clip, select_bouts(bouts_of(clip)).bouts, symmetric)


def rmse_deg(fit: CyclicFit, curves) -> dict[str, float]:
    frames = len(fit.motion.root)
    truth = curves(np.arange(frames) / frames)
    found = joint_angles(fit.motion.rotations)
    return {name: float(np.degrees(np.sqrt(np.mean((found[name] - truth[name]) ** 2)))) for name in truth}


def test_clean_walker_comes_back(walker):
    w = walker()
    fit = loop_of(w.clip)
    motion = fit.motion
    assert motion.duration == pytest.approx(w.period, rel=2e-3)
    assert len(motion.root) == 66 and motion.cyclic
    assert max(rmse_deg(fit, w.curves).values()) < 1.0
    assert fit.reliability.precise and fit.reliability.pelvis and fit.reliability.feet
    assert fit.scale == pytest.approx(1 / w.size, rel=1e-3)


@pytest.mark.parametrize(
    ("width", "precise", "given"), [(0.28, True, None), (0.28, False, 0.16), (0.02, True, 0.08)]
)
def test_a_wide_gait_is_kept_of_a_precise_recording(walker, width, precise, given):
    """As with ataxia. A depth sensor's is not believed, and soles cannot pass through each other."""
    w = walker(seconds=6.0)
    clip = swaying(w.clip, np.zeros(len(w.clip.times)), width)
    clip = clip if precise else changing_bones(clip)
    fit = loop_of(clip)
    scaled = width * fit.scale
    assert fit.width == pytest.approx(scaled, abs=0.002)
    assert stance_width(fit.motion.kinematics()[0]) == pytest.approx(given or scaled, abs=0.002)
    bouts = bouts_of(clip)
    excerpt = excerpt_of_bout(max(bouts, key=lambda one: one.cycles), straighten=True)
    recorded = fit_noncyclic(clip, excerpt)
    assert stance_width(recorded.motion.kinematics()[0]) == pytest.approx(given or scaled, abs=0.002)
    report = noncyclic_report(clip, bouts, excerpt, recorded, recorded.motion, None, "")
    assert any("ankles are" in text for text in report["warnings"]) == (given is not None)


def test_a_wide_gait_is_kept_though_its_pelvis_does_not_repeat(walker):
    w = walker(seconds=6.0)
    clip = swaying(w.clip, np.zeros(len(w.clip.times)), 0.28)
    tilt = 0.012 * np.sin(2.0 * np.pi * clip.times / 1.7)
    clip.positions[:, N["hip_left"], 2] += tilt
    clip.positions[:, N["hip_right"], 2] -= tilt
    fit = loop_of(clip)
    assert not fit.reliability.precise and fit.reliability.flat_feet
    assert stance_width(fit.motion.kinematics()[0]) == pytest.approx(0.28 * fit.scale, abs=0.002)


def test_standing_before_and_after_a_walk_does_not_enter_the_loop(walker):
    """The loop is that of the walk alone, and nothing of the standing is pooled."""
    alone, stands = loop_of(walker(seconds=5.5).clip), loop_of(stand_walk_stand())
    shown = [joint_angles(one.motion.rotations) for one in (alone, stands)]
    for name in ("knee_left", "knee_right"):
        assert np.degrees(np.sqrt(np.mean((shown[0][name] - shown[1][name]) ** 2))) < 1.5
        assert np.degrees(np.abs(shown[0][name] - shown[1][name]).max()) < 4.0
    assert stands.motion.duration == pytest.approx(1.1, rel=5e-3)


def test_feet_in_contact_do_not_slide_and_the_ground_is_zero(walker):
    w = walker()
    fit = loop_of(w.clip)
    motion = fit.motion
    corners = sole_positions(*motion.kinematics())
    velocity = at_lowest_corner(corners, corner_velocity(corners, motion.rate, motion.cycle_offset))[:, 0, 0]
    phase = np.arange(len(velocity)) / len(velocity)
    assert abs(velocity[(phase > 0.12) & (phase < 0.46)].mean()) < 0.02 * fit.path.speed
    assert fit.path.speed == pytest.approx(w.speed / w.size, rel=0.1)
    assert fit.path.slip < 0.12
    assert fit.path.penetration < 0.025 and fit.path.floating < 0.025
    assert np.all(fit.motion.root[0, :2] == 0)
    assert fit.motion.cycle_offset == pytest.approx([fit.path.speed * fit.motion.duration, 0, 0])


def test_heading_does_not_matter(walker):
    straight, turned = loop_of(walker().clip), loop_of(walker(heading=2.2).clip)
    assert np.degrees(angle_between(straight.motion.rotations, turned.motion.rotations)).max() < 1e-3
    assert turned.motion.root == pytest.approx(straight.motion.root, abs=1e-3)


def test_mirrored_walker_gives_the_mirrored_loop(walker):
    clip = walker(limp=20.0, seconds=4.4).clip
    image = replace(clip, positions=clip.positions[:, MIRROR] * [1, -1, 1])
    one, other = loop_of(clip, False).motion, loop_of(image, False).motion
    half = len(one.root) // 2
    expected = np.roll(one.rotations, -half, axis=0)[:, MIRROR] * [-1, 1, -1, 1]
    assert np.degrees(angle_between(expected, other.rotations)).max() < 0.5


def test_a_limp_survives_unless_symmetry_is_asked_for(walker):
    w = walker(limp=20.0, seconds=4.4)
    knees = joint_angles(loop_of(w.clip).motion.rotations)
    peaks = {side: np.degrees(knees[f"knee_{side}"].max()) for side in ("left", "right")}
    truth = {side: np.degrees(w.curves(np.arange(100) / 100)[f"knee_{side}"].max()) for side in peaks}
    assert peaks == pytest.approx(truth, abs=1.5)
    even = joint_angles(loop_of(w.clip, True).motion.rotations)
    assert even["knee_left"].max() == pytest.approx(even["knee_right"].max(), abs=0.01)


def test_frames_with_swapped_legs_are_rejected(walker):
    w = walker(seconds=4.4)
    p = w.clip.positions.copy()
    legs = [N[f"{joint}_left"] for joint in ("hip", "knee", "ankle", "foot")]
    other = [N[f"{joint}_right"] for joint in ("hip", "knee", "ankle", "foot")]
    span = slice(100, 115)
    p[span, legs], p[span, other] = p[span, other].copy(), p[span, legs].copy()
    fit = loop_of(replace(w.clip, positions=p), False)
    assert max(rmse_deg(fit, w.curves).values()) < 1.5


def test_sensor_noise_stays_below_four_degrees(walker):
    w = walker(noise=0.012, passes=3, rate=30.0, seconds=2.6)
    fit = loop_of(w.clip)
    errors = rmse_deg(fit, w.curves)
    assert not fit.reliability.precise and not fit.reliability.feet
    assert max(errors.values()) < 4.0
    assert joint_angles(fit.motion.rotations)["knee_left"].min() > -0.02


def test_missing_frames_are_bridged(walker):
    w = walker()
    p, states = w.clip.positions.copy(), w.clip.states.copy()
    p[40:60, N["knee_left"]] = np.nan
    states[40:60, N["knee_left"]] = 0
    assert max(rmse_deg(loop_of(replace(w.clip, positions=p, states=states)), w.curves).values()) < 1.0


def test_ankles_that_jump_between_the_legs_are_no_walk(walker):
    w = walker()
    rng = np.random.default_rng(1)
    p = w.clip.positions.copy()
    swap = rng.random(len(p)) < 0.5
    a, b = N["ankle_left"], N["ankle_right"]
    p[np.ix_(swap, [a, b])] = p[np.ix_(swap, [b, a])]
    assert bouts_of(replace(w.clip, positions=p)) == []


def test_a_movement_in_place_is_no_gait(walker):
    clip = walker().clip
    t = clip.times
    standing = np.repeat(clip.positions[:1], len(t), axis=0)
    # One frame of the walk has a leg behind: stand upright instead, and lift the left forearm.
    for side in ("left", "right"):
        hip = standing[:, N[f"hip_{side}"]]
        standing[:, N[f"knee_{side}"]] = hip - [0, 0, 0.44]
        standing[:, N[f"ankle_{side}"]] = hip - [0, 0, 0.86]
        standing[:, N[f"foot_{side}"]] = hip - [-0.12, 0, 0.89]
    lift = from_axis_angle("Y", -0.8 * (1 - np.cos(2 * np.pi * t / 3)))
    elbow = standing[:, N["elbow_left"]]
    standing[:, N["wrist_left"]] = elbow + rotate(lift, np.array([0, 0, -0.27]))
    still = replace(clip, positions=standing)
    assert bouts_of(still) == []
    fit = fit_noncyclic(still, excerpt_of_pass(still, 0))
    motion = fit.motion
    assert fit.reliability.precise and not motion.cyclic
    assert motion.contacts.all() and fit.seen.shape == motion.rotations.shape[:2]
    assert motion.duration == pytest.approx(t[-1] - t[0], abs=0.02)
    assert np.abs(motion.root[:, :2]).max() < 1e-9
    bend = -2 * np.arctan2(motion.rotations[:, N["elbow_left"], 1], motion.rotations[:, N["elbow_left"], 3])
    # The upper arm of the first frame hangs 0.3 rad behind the vertical from which the lift counts.
    assert bend.max() == pytest.approx(1.6 + 0.3, abs=0.02)


def test_one_stride_of_few_frames_has_fewer_harmonics_but_its_knees_turn(walker):
    """26 frames cannot hold the 17 coefficients of eight harmonics."""
    w = walker(seconds=1.3, rate=20.0)
    (one,) = bouts_of(w.clip)
    assert len(one.frames) < 34
    fit = fit_cyclic(w.clip, [one], False)
    assert fit.reliability.precise
    assert len(fit.loop.joints["knee_left"].coefficients) < 1 + 2 * LEG_HARMONICS[True]
    assert max(rmse_deg(fit, w.curves).values()) < 2.5


def test_less_than_a_stride_is_completed_by_the_mirror_or_refused(walker):
    clip = walker(seconds=0.85).clip
    (one,) = bouts_of(clip)
    assert fit_cyclic(clip, [one]).symmetric
    with pytest.raises(KinemimicError, match="whole stride"):
        fit_cyclic(clip, [one], False)


@pytest.mark.parametrize(("limp", "averaged"), [(0.0, True), (24.0, False)])
def test_noise_averages_the_sides_away_only_where_it_explains_their_difference(walker, limp, averaged):
    """The difference stays below the noise of single frames, but it returns in every stride."""
    fit = loop_of(walker(limp=limp, noise=0.02, rate=60.0, seconds=13.2).clip)
    assert not fit.reliability.precise
    assert fit.asymmetry_deg < 2.0 * fit.noise_deg
    assert fit.symmetric == averaged
    assert (fit.asymmetry_deg < fit.asymmetry_limit_deg) == averaged


@pytest.mark.parametrize("size", [0.7, 0.9])
def test_the_size_of_the_person_changes_the_scale_and_nothing_else(walker, size):
    """A child who moves as an adult has the adult's rotations; all ways are as long on the one body."""
    adult, child = loop_of(walker(size=1.1).clip), loop_of(walker(size=size).clip)
    assert child.scale == pytest.approx(1.0 / size, rel=1e-3)
    assert child.motion.duration == pytest.approx(adult.motion.duration, rel=1e-6)
    assert np.degrees(angle_between(child.motion.rotations, adult.motion.rotations)).max() < 0.05
    np.testing.assert_allclose(child.motion.root, adult.motion.root, atol=1e-3)
    np.testing.assert_allclose(child.motion.cycle_offset, adult.motion.cycle_offset, atol=1e-3)


@pytest.mark.parametrize("rate", [30.0, 120.0])
def test_the_loop_does_not_depend_on_the_rate_of_the_recording(walker, rate):
    usual, other = loop_of(walker(rate=60.0, seconds=4.4).clip), loop_of(walker(rate=rate, seconds=4.4).clip)
    assert other.motion.duration == pytest.approx(usual.motion.duration, rel=1e-3)
    assert len(other.motion.root) == len(usual.motion.root)
    assert np.degrees(angle_between(other.motion.rotations, usual.motion.rotations)).max() < 0.5
    assert other.path.speed == pytest.approx(usual.path.speed, rel=0.01)


def test_neither_the_place_nor_the_origin_of_the_clock_changes_the_loop(walker):
    clip = walker(passes=2, limp=10.0).clip
    moved = replace(clip, times=clip.times + 1000.0, positions=clip.positions + np.array([7.0, -3.0, 0.0]))
    one, other = loop_of(clip).motion, loop_of(moved).motion
    assert np.degrees(angle_between(one.rotations, other.rotations)).max() < 1e-4
    np.testing.assert_allclose(other.root, one.root, atol=1e-6)
    np.testing.assert_array_equal(other.contacts, one.contacts)


@pytest.mark.parametrize("limp", [0.0, 10.0, 20.0])
def test_the_difference_of_the_sides_is_the_limps(walker, limp):
    """The rms over a cycle, of the knees and of the hips, which do not limp."""
    w = walker(limp=limp, seconds=4.4)
    fit = loop_of(w.clip, False)
    phase = np.arange(200) / 200.0
    left, right = w.curves(phase)["knee_left"], w.curves(phase + 0.5)["knee_right"]
    expected = np.degrees(np.sqrt(np.mean((left - right) ** 2) / 2.0))
    # By hand: the curve's swing exp((cos x - 1) / 0.36) has the mean square exp(-2 / 0.36) I0(2 / 0.36).
    assert expected == pytest.approx(limp * np.sqrt(0.5 * i0e(2.0 / 0.36)), abs=1e-6)
    assert fit.asymmetry_deg == pytest.approx(expected, abs=0.25)
    # Without noise, the loop differs from the walk only by what its harmonics cannot follow.
    assert fit.noise_deg < 0.5


def test_the_noise_is_the_rms_distance_of_the_captured_angles_from_the_loop(walker):
    fit = loop_of(walker(limp=10.0).clip, False)
    shown = joint_angles(fit.loop.rotations(fit.strides.phase))
    assert asymmetry_and_noise(fit.loop, fit.strides, shown)[1] == pytest.approx(0.0, abs=1e-9)
    # Knees off by 3 degrees, of which every second frame is missing, and hips by -1.
    off = {name: curve + np.radians(3.0 if "knee" in name else -1.0) for name, curve in shown.items()}
    off["knee_left"][::2] = np.nan
    off["knee_right"][::2] = np.nan
    rows = np.isfinite(off["knee_left"]).mean()
    expected = np.sqrt((9.0 * rows + 1.0) / (1.0 + rows))
    assert asymmetry_and_noise(fit.loop, fit.strides, off)[1] == pytest.approx(expected)


def test_a_jog_slower_than_a_brisk_walk_keeps_its_flight():
    """1.8 m/s on the body. In flight the feet bear nothing, and none floats while one does."""
    clip = stepping("run", length=0.55)
    closed = loop_of(clip)
    assert closed.path.running and closed.path.speed == pytest.approx(
        closed.scale * closed.loop.speed, rel=0.05
    )
    motion = refine(closed.motion)
    rise = closed.scale * np.ptp(hips(clip.positions)[..., 2])
    for one in (closed.motion, motion):
        assert np.ptp(one.root[:, 2]) == pytest.approx(rise, rel=0.15)
        low = sole_positions(*one.kinematics())[..., 2].min(axis=(1, 2))
        assert np.mean(low > 0.02) > 0.3
        assert not one.contacts[low > 0.05].any()
    path = measure_path(motion, closed.path)
    assert path.floating < 0.01 and path.penetration < 0.01 and path.slip < 0.05


def test_a_walk_faster_than_a_jog_has_no_flight():
    fit = loop_of(stepping("walk", length=1.6, cadence=1.5))
    assert not fit.path.running and fit.path.follows and fit.path.speed > 2.1
    low = sole_positions(*refine(fit.motion).kinematics())[..., 2].min(axis=(1, 2))
    assert low.max() < 0.01


def test_a_jog_has_no_walkers_ankles():
    clip = stepping("run", length=0.55)
    stir = 0.012 * np.random.default_rng(2).standard_normal(clip.positions.shape)
    noisy = replace(clip, positions=clip.positions + stir)
    bouts = select_bouts(bouts_of(noisy)).bouts
    neutral, normal = (fit_cyclic(noisy, bouts, ankle=ankle) for ankle in ("neutral", "normal"))
    assert not neutral.reliability.feet
    np.testing.assert_array_equal(normal.motion.rotations, neutral.motion.rotations)
