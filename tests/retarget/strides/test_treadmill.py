"""Walkers on a belt of known speed, and people without a treadmill."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from kinemimic.pipeline.convert import convert, on_nodes
from kinemimic.pipeline.files.store import read_clip
from kinemimic.pipeline.gait.parameters import measure_gait
from kinemimic.pipeline.ingest import ingest
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import IDENTITY, angle_between, from_axis_angle, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import node_skeleton
from kinemimic.retarget.cyclic import fit_cyclic
from kinemimic.retarget.feet.scale import body_kinematics
from kinemimic.retarget.humanoid.body import STANDING_HEIGHT
from kinemimic.retarget.noncyclic import fit_noncyclic, longest_walk
from kinemimic.retarget.strides.passes import analyze_passes, is_gait, select_passes
from kinemimic.retarget.strides.treadmill import add_belt_travel


def on_belt(walker, **options):
    """A walker over the ground and the same one kept in place."""
    w = walker(seconds=8.0, **options)
    still = w.clip.positions.copy()
    still[..., :2] -= w.clip.positions[:, :1, :2] - w.clip.positions[:1, :1, :2]
    return w, replace(w.clip, positions=still)


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
    return Clip(
        skeleton=node_skeleton(),
        times=times,
        positions=rotate(from_axis_angle("Z", heading), p),
        states=np.full(p.shape[:2], 2, dtype=np.uint8),
        passes=np.zeros(len(times), dtype=np.int32),
    )


@pytest.mark.parametrize(("belt", "heading"), [(1.2, 0.0), (0.8, 2.2)])
def test_the_travel_of_the_belt_is_added(belt, heading):
    still = stepping(belt, heading)
    found, speeds = add_belt_travel(still)
    assert speeds == {0: pytest.approx(belt, rel=0.03)}
    way = found.positions[-1, 0] - found.positions[0, 0]
    assert np.arctan2(way[1], way[0]) == pytest.approx(heading, abs=0.05)
    # Every node goes with it.
    moved = found.positions - still.positions
    assert np.abs(moved - moved[:, :1]).max() < 1e-9


def test_frames_without_hips_keep_the_belt():
    still = stepping(1.2, 0.0)
    positions = still.positions.copy()
    positions[100:104, [N["hip_left"], N["hip_right"]]] = np.nan
    positions[200:203] = np.nan
    _, speeds = add_belt_travel(replace(still, positions=positions))
    assert speeds == {0: pytest.approx(1.2, rel=0.03)}


def test_a_belt_that_speeds_up_is_followed():
    slow, fast = stepping(0.8, 0.0), stepping(1.4, 0.0)
    clip = replace(
        slow,
        times=np.concatenate([slow.times, 8.0 + fast.times]),
        positions=np.concatenate([slow.positions, fast.positions]),
        states=np.concatenate([slow.states, fast.states]),
        passes=np.zeros(2 * len(slow.times), dtype=np.int32),
    )
    found, speeds = add_belt_travel(clip)
    assert speeds == {0: pytest.approx(1.1, rel=0.05)}
    x = found.positions[:, 0, 0]
    half = len(x) // 2
    assert (x[half - 120] - x[0]) / (6.0) == pytest.approx(0.8, rel=0.05)
    assert (x[-1] - x[half + 120]) / (6.0) == pytest.approx(1.4, rel=0.05)


def test_clips_without_a_treadmill_are_unchanged(walker):
    w = walker(seconds=8.0)
    still = replace(w.clip, positions=np.repeat(w.clip.positions[:1], len(w.clip.times), axis=0))
    kicks = w.clip.positions.copy() - (w.clip.positions[:, :1] - w.clip.positions[:1, :1])
    # One leg alone swings to and fro.
    kicks[:, N["ankle_left"]] = kicks[:1, N["ankle_left"]]
    for clip in (w.clip, still, replace(w.clip, positions=kicks)):
        found, speeds = add_belt_travel(clip)
        assert speeds == {} and found is clip


def test_feet_that_move_backward_while_high_are_not_on_a_belt(walker):
    _, still = on_belt(walker)
    # The film reversed: the feet go back while they are high.
    back = replace(still, positions=still.positions[::-1].copy())
    assert add_belt_travel(back)[1] == {}


def test_a_treadmill_gives_the_same_loop_as_the_ground(walker):
    w, still = on_belt(walker)
    loops = []
    for clip in (w.clip, add_belt_travel(still)[0]):
        loops.append(fit_cyclic(clip, select_passes(analyze_passes(clip))[0], False).motion)
    assert len(loops[0].root) == len(loops[1].root)
    assert np.degrees(angle_between(loops[0].rotations, loops[1].rotations)).max() < 1.0
    assert loops[1].cycle_offset == pytest.approx(loops[0].cycle_offset, abs=0.02)


def test_a_walk_kept_as_recorded_has_the_speed_at_which_feet_do_not_slide(walker):
    w, still = on_belt(walker)
    clip, _ = add_belt_travel(still)
    passes = analyze_passes(clip)
    assert is_gait(passes)
    fit = fit_noncyclic(clip, longest_walk(clip, passes))
    motion = fit.motion
    assert not motion.cyclic and fit.strides == pytest.approx(8.0 / w.period, abs=0.4)
    assert motion.duration == pytest.approx(8.0, abs=0.1)
    speed = (motion.root[-1, 0] - motion.root[0, 0]) / motion.duration
    # Its ankles do not stand quite still themselves, and a sole rolls about them.
    assert speed == pytest.approx(w.speed / w.size, rel=0.1)
    assert 0.4 < motion.contacts.mean() < 0.8
    assert motion.contacts.any(axis=1).mean() > 0.8


def test_two_strides_on_a_belt_are_enough():
    assert add_belt_travel(stepping(1.2, 0.0, seconds=2.5))[1] == {0: pytest.approx(1.2, rel=0.03)}
    assert add_belt_travel(stepping(1.2, 0.0, seconds=1.5))[1] == {}


@pytest.mark.parametrize(
    ("file", "speed"),
    [
        # Markers on the foot while it lies flat: 1.12 to 1.13, and on the toes in stance 3.85 to 3.96 m/s.
        ("Gait2354_Simbody__subject01_walk1.trc", 1.13),
        ("Hamner__subject02_running.trc", 3.9),
    ],
)
def test_the_belt_speed_of_a_real_treadmill_agrees_with_markers_and_gait_report(
    captures, tmp_path, file, speed
):
    ingest(captures / "lab_opensim_gait" / file, tmp_path)
    convert(tmp_path)
    clip = on_nodes(read_clip(tmp_path / "quaternions.parquet"))
    found = add_belt_travel(clip)[1]
    assert found == {0: pytest.approx(speed, rel=0.02)}
    assert found[0] == pytest.approx(measure_gait(clip.times, clip.passes, clip.positions).belt, rel=0.01)
