"""The path over the ground from the feet: the same on a floor, on a treadmill and before a turning camera."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from samples.bouts import bouts_of
from samples.corpus import cmu, recorded
from samples.other_steps import stepping as stepping_as
from samples.walker import before_turning_camera, hips, in_place, on_belt, walker

from kinemimic.pipeline.convert import convert, on_nodes, read_converted
from kinemimic.pipeline.gait.parameters import measure_gait
from kinemimic.pipeline.ingest import ingest
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import IDENTITY, from_axis_angle, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import node_skeleton
from kinemimic.retarget.cyclic import fit_cyclic
from kinemimic.retarget.feet.scale import body_kinematics
from kinemimic.retarget.humanoid.body import STANDING_HEIGHT
from kinemimic.retarget.humanoid.motion import joint_angles
from kinemimic.retarget.noncyclic import fit_noncyclic
from kinemimic.retarget.optimise.refine import refine
from kinemimic.retarget.strides.excerpt import excerpt_of_bout

# The ankles of `stepping` stand quite still until they leave; a person's roll forward by 2 to 11 % of the
# speed, which the feet's path takes into account.
STIFF = 0.1
CMU_WALKS = ("02_01", "02_02", "05_01", "06_01", "07_01", "07_03", "07_05", "07_09", "07_12")
WITHOUT_PATH: tuple[Callable[[Clip], Clip], ...] = (in_place, before_turning_camera)


def stepping(belt: float, heading: float, rate: float = 60.0, seconds: float = 8.0) -> Clip:
    """A person in place whose ankles move back with the belt for 60 % of 1.1 s, then forward and raised."""
    times = np.arange(round(seconds * rate)) / rate
    upright = body_kinematics(np.tile(IDENTITY, (1, 20, 1)), np.array([[0.0, 0.0, STANDING_HEIGHT]]))[0]
    p = np.repeat(upright, len(times), axis=0)
    for side, shift in (("left", 0.0), ("right", 0.5)):
        stride = np.mod(times / 1.1 + shift, 1.0)
        swing = np.maximum(stride - 0.6, 0.0) / 0.4
        length = belt * 0.66
        ahead = np.where(stride < 0.6, 0.5 * length - belt * 1.1 * stride, length * (swing - 0.5))
        for joint in ("ankle", "foot"):
            p[:, N[f"{joint}_{side}"], 0] += ahead
            p[:, N[f"{joint}_{side}"], 2] += 0.1 * np.sin(np.pi * swing)
            # The knee above the middle of the leg: bones keep their length to some centimetres.
        p[:, N[f"knee_{side}"], 0] += 0.5 * ahead
    return Clip(
        skeleton=node_skeleton(),
        times=times,
        positions=rotate(from_axis_angle("Z", heading), p),
        states=np.full(p.shape[:2], 2, dtype=np.uint8),
        passes=np.zeros(len(times), dtype=np.int32),
    )


@pytest.mark.parametrize(("belt", "heading"), [(1.2, 0.0), (0.8, 2.2), (0.5, -1.0)])
def test_the_speed_of_a_belt(belt: float, heading: float) -> None:
    (one,) = bouts_of(stepping(belt, heading))
    assert one.path.source == "feet"
    assert one.speed == pytest.approx(belt, rel=STIFF)
    assert np.angle(np.exp(1j * (one.heading - heading))) == pytest.approx(0.0, abs=0.05)


def test_frames_without_hips_keep_the_belt() -> None:
    still = stepping(1.2, 0.0)
    still.positions[100:104, [N["hip_left"], N["hip_right"]]] = np.nan
    still.positions[200:203] = np.nan
    (one,) = bouts_of(still)
    (whole,) = bouts_of(stepping(1.2, 0.0))
    assert one.speed == pytest.approx(whole.speed, rel=0.01)


def test_a_belt_that_speeds_up_is_followed() -> None:
    slow, fast = stepping(0.8, 0.0), stepping(1.4, 0.0)
    clip = replace(
        slow,
        times=np.concatenate([slow.times, 8.0 + fast.times]),
        positions=np.concatenate([slow.positions, fast.positions]),
        states=np.concatenate([slow.states, fast.states]),
        passes=np.zeros(2 * len(slow.times), dtype=np.int32),
    )
    found = bouts_of(clip)
    x = np.concatenate([np.gradient(hips(one.positions)[:, 0, 0], clip.times[one.frames]) for one in found])
    at = np.concatenate([clip.times[one.frames] for one in found])
    assert np.mean(x[(at > 1.0) & (at < 6.5)]) == pytest.approx(0.8, rel=STIFF)
    assert np.mean(x[(at > 9.5) & (at < 15.0)]) == pytest.approx(1.4, rel=STIFF)


def test_a_person_who_stands_is_not_carried_anywhere() -> None:
    w = walker(seconds=8.0)
    still = replace(w.clip, positions=np.repeat(w.clip.positions[:1], len(w.clip.times), axis=0))
    assert bouts_of(still) == []


@pytest.mark.parametrize("without_path", WITHOUT_PATH)
@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_a_walk_without_its_path_gives_the_loop_of_the_walk_with_it(
    without_path: Callable[[Clip], Clip], noise: float
) -> None:
    w = walker(seconds=5.0, noise=noise)
    loops = [fit_cyclic(clip, bouts_of(clip), False).motion for clip in (w.clip, without_path(w.clip))]
    assert abs(len(loops[0].root) - len(loops[1].root)) <= 1
    # This walker's ankle in stance moves less evenly than a person's.
    assert loops[1].cycle_offset[0] == pytest.approx(loops[0].cycle_offset[0], rel=0.05)
    curves = [joint_angles(loop.rotations) for loop in loops]
    for name, curve in curves[0].items():
        other = curves[1][name]
        same = np.interp(np.linspace(0, 1, 60), np.linspace(0, 1, len(other)), other)
        apart = np.interp(np.linspace(0, 1, 60), np.linspace(0, 1, len(curve)), curve) - same
        assert np.degrees(np.sqrt(np.mean(apart**2))) < 1.0


def test_a_walk_in_place_kept_as_recorded_has_the_speed_at_which_feet_do_not_slide() -> None:
    w = walker(seconds=8.0)
    still = in_place(w.clip)
    (one,) = bouts_of(still)
    fit = fit_noncyclic(still, excerpt_of_bout(one, straighten=True))
    motion = fit.motion
    assert not motion.cyclic and fit.strides == pytest.approx(8.0 / w.period, abs=0.4)
    assert motion.duration == pytest.approx(8.0, abs=0.1)
    speed = (motion.root[-1, 0] - motion.root[0, 0]) / motion.duration
    # Its ankles do not stand quite still themselves, and a sole rolls about them.
    assert speed == pytest.approx(w.speed / w.size, rel=0.1)
    assert 0.4 < motion.contacts.mean() < 0.8
    assert motion.contacts.any(axis=1).mean() > 0.8


@pytest.mark.parametrize("name", CMU_WALKS)
def test_optical_walks_without_their_path_keep_speed_length_and_curves(name: str) -> None:
    clip = cmu(name)
    longest = max(bouts_of(clip), key=lambda one: one.cycles)
    known = joint_angles(refine(fit_cyclic(clip, [longest]).motion).rotations)
    for without_path in WITHOUT_PATH:
        other = without_path(clip)
        found = max(bouts_of(other), key=lambda one: one.cycles)
        assert found.path.source == "feet"
        root = hips(clip.positions)[found.frames, 0, :2]
        way = float(np.linalg.norm(root[-1] - root[0]))
        seconds = float(np.ptp(clip.times[found.frames]))
        assert found.speed == pytest.approx(way / seconds, rel=0.05)
        # Measured: 0 to 2.2 %, and 3.7 % on 05_01, whose last step is shorter.
        assert np.ptp(hips(found.positions)[[0, -1], 0, 0]) == pytest.approx(way, rel=0.04)
        curves = joint_angles(refine(fit_cyclic(other, [found]).motion).rotations)
        for joint, curve in known.items():
            same = np.interp(np.linspace(0, 1, 60), np.linspace(0, 1, len(curves[joint])), curves[joint])
            apart = np.interp(np.linspace(0, 1, 60), np.linspace(0, 1, len(curve)), curve) - same
            assert np.degrees(np.sqrt(np.mean(apart**2))) < 1.0, joint


@pytest.mark.parametrize(
    ("file", "speed"),
    [
        # Markers on the foot while it lies flat: 1.12 to 1.13, and on the toes in stance 3.85 to 3.96 m/s.
        ("Gait2354_Simbody__subject01_walk1.trc", 1.13),
        ("Hamner__subject02_running.trc", 3.9),
    ],
)
def test_the_belt_speed_of_a_real_treadmill_agrees_with_markers(captures, tmp_path, file, speed):  # type: ignore[no-untyped-def]
    ingest(captures / "lab_opensim_gait" / file, tmp_path)
    convert(tmp_path)
    found = bouts_of(on_nodes(read_converted(tmp_path)))
    assert found and all(one.path.source == "feet" for one in found)
    assert max(found, key=lambda one: one.cycles).speed == pytest.approx(speed, rel=0.05)


@pytest.mark.parametrize(
    ("file", "width"),
    [
        # Between the lines on which the ankles slide: 133 and 31 mm. By the feet alone, the run's were 64.
        ("lab_opensim_gait/Gait2354_Simbody__subject01_walk1.trc", 0.133),
        ("lab_opensim_gait/Hamner__subject02_running.trc", 0.031),
    ],
)
def test_the_step_width_on_a_real_treadmill_is_that_in_the_laboratory(captures, file, width):  # type: ignore[no-untyped-def]
    clip = recorded(captures / file)
    strides = measure_gait(clip.times, clip.passes, clip.positions).strides
    assert np.mean([stride.width for stride in strides]) == pytest.approx(width, abs=0.006)


def straight_part(clip: Clip) -> Clip:
    """The frames of the longest bout of a clip."""
    frames = max(bouts_of(clip), key=lambda one: one.cycles).frames
    return Clip(
        skeleton=clip.skeleton,
        times=clip.times[frames],
        positions=clip.positions[frames],
        states=clip.states[frames],
        passes=np.zeros(len(frames), dtype=np.int32),
    )


@pytest.mark.parametrize("name", [*CMU_WALKS, "09_01"])
@pytest.mark.parametrize("heading", [0.0, 0.7])
def test_on_a_belt_optical_walks_and_a_run_keep_their_path_and_step_width(name: str, heading: float) -> None:
    """By the feet alone, hips were 2 to 9 mm off their path, and 44 in the run, whose steps were four times
    too wide."""
    clip = straight_part(cmu(name))
    spot = on_belt(clip)
    spot = replace(spot, positions=rotate(from_axis_angle("Z", heading), spot.positions))
    known, found = (max(bouts_of(one), key=lambda bout: bout.cycles) for one in (clip, spot))
    assert known.path.source == "recorded" and found.path.source == "feet"
    _, mine, theirs = np.intersect1d(known.frames, found.frames, return_indices=True)
    off = hips(found.positions)[theirs, 0] - hips(known.positions)[mine, 0]
    at = np.arange(len(off))
    drift = np.polyfit(at, off, 1)[0]
    assert np.std(off - at[:, None] * drift, axis=0).max() < 0.003
    # The belt runs as the walk did, to a degree.
    assert abs(drift[1]) < 0.0175 * np.polyfit(at, hips(known.positions)[mine, 0, 0], 1)[0]
    widths = [
        np.mean([stride.width for stride in measure_gait(one.times, one.passes, one.positions).strides])
        for one in (clip, spot)
    ]
    assert widths[1] == pytest.approx(widths[0], abs=0.002)


@pytest.mark.parametrize("size", [1.0, 0.75, 0.6])
def test_a_child_who_walks_briskly_does_not_run(size: float) -> None:
    """Dynamically similar: the time scales with the root of the size, as a pendulum's."""
    clip = cmu("07_12")
    begin = clip.times[0]
    child = replace(clip, times=begin + np.sqrt(size) * (clip.times - begin), positions=size * clip.positions)
    found = bouts_of(child)
    assert found
    assert not any(bout.running for bout in found)


@pytest.mark.parametrize("quicker", [1.1, 1.2, 1.4])
def test_a_brisk_walker_does_not_run(quicker: float) -> None:
    """The heel of the rear foot is as high as a jogger's, but the hips vault over the foot in stance."""
    clip = cmu("07_12")
    begin = clip.times[0]
    found = bouts_of(replace(clip, times=begin + (clip.times - begin) / quicker))
    assert found and not any(bout.running for bout in found)


@pytest.mark.parametrize("seen", [replace, in_place])
@pytest.mark.parametrize("slope", [-0.15, -0.2])
def test_a_walker_down_a_slope_does_not_run(slope: float, seen: Callable[[Clip], Clip]) -> None:
    """There, the rear foot stands higher."""
    found = bouts_of(seen(stepping_as("walk", cadence=1.4, slope=slope)))
    assert found and not any(bout.running for bout in found)


@pytest.mark.parametrize("noise", [0.0, 0.012])
@pytest.mark.parametrize(("length", "slope"), [(1.0, -0.2), (1.0, 0.1), (0.55, 0.0), (0.4, 0.0)])
def test_a_jogger_runs(length: float, slope: float, noise: float) -> None:
    clip = stepping_as("run", length=length, slope=slope)
    stir = noise * np.random.default_rng(2).standard_normal(clip.positions.shape)
    found = bouts_of(replace(clip, positions=clip.positions + stir))
    assert found and all(bout.running for bout in found)


def test_a_walker_whose_path_sinks_does_not_run(sensors, tmp_path):  # type: ignore[no-untyped-def]
    """A walk of 1.5 m/s in a phone's video: a network takes it down a slope that was not there."""
    ingest(sensors / "video_opencap" / "walk" / "sample_wham.json", tmp_path)
    convert(tmp_path)
    (one,) = bouts_of(on_nodes(read_converted(tmp_path)))
    assert not one.running


@pytest.mark.parametrize("fixed", ["hip_center", "spine"])
@pytest.mark.parametrize("length", [1.0, 0.55])
def test_a_runner_whose_root_was_left_out_runs(fixed: str, length: float) -> None:
    """The hips still move a little about the point that is fixed."""
    clip = stepping_as("run", length=length)
    still = clip.positions - clip.positions[:, [N[fixed]]]
    found = bouts_of(replace(clip, positions=still + np.array([0.0, 0.0, 1.0])))
    assert found and all(bout.running for bout in found)


@pytest.mark.parametrize("lowest", [("foot",), ("ankle", "foot")])
def test_a_runner_whose_frames_were_put_on_the_ground_one_by_one_runs(lowest: tuple[str, ...]) -> None:
    """Without the flight, the hips are lowest when the feet are farthest apart."""
    clip = stepping_as("run", length=0.7)
    nodes = [N[f"{joint}_{side}"] for joint in lowest for side in ("left", "right")]
    positions = clip.positions.copy()
    positions[..., 2] -= clip.positions[:, nodes, 2].min(axis=1)[:, None]
    found = bouts_of(replace(clip, positions=positions))
    assert found and all(bout.running for bout in found)
