"""Nothing flips: from frame to frame no bone turns much further than its points moved."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.kinematics.orientation.from_positions import node_frames, node_rotations
from kinemimic.pipeline.kinematics.orientation.trunk import direction
from kinemimic.pipeline.kinematics.orientation.twist import follow_twist
from kinemimic.pipeline.kinematics.rotations import angle_between, from_axis_angle, from_euler, multiply
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.quality.check import check_capture
from kinemimic.pipeline.readers.recognise import read
from tests.pipeline.kinematics.orientation.test_from_positions import positions_of, standing

# Lines whose directions a body's frame hangs on.
_PELVIS = (("hip_right", "hip_left"), ("hip_center", "spine"))
_TORSO = (("shoulder_right", "shoulder_left"), ("spine", "shoulder_center"))
LINES = {"hip_center": _PELVIS, "spine": _TORSO, "shoulder_center": (*_TORSO, ("shoulder_center", "head"))}
for _side in ("left", "right"):
    _leg = ((f"hip_{_side}", f"knee_{_side}"), (f"knee_{_side}", f"ankle_{_side}"))
    _arm = ((f"shoulder_{_side}", f"elbow_{_side}"), (f"elbow_{_side}", f"wrist_{_side}"))
    LINES |= {f"{joint}_{_side}": (*_PELVIS, *_leg) for joint in ("hip", "knee")}
    LINES |= {f"{joint}_{_side}": (*_TORSO, *_arm) for joint in ("shoulder", "elbow")}
    LINES[f"ankle_{_side}"] = (*_PELVIS, *_leg, (f"ankle_{_side}", f"foot_{_side}"))
    LINES[f"wrist_{_side}"] = (*_TORSO, *_arm, (f"wrist_{_side}", f"hand_{_side}"))


def flips(positions, passes=None) -> int:
    """Steps of a node's frame by more than 45 degrees and three times what its lines moved by."""
    frames = node_frames(positions)
    moved = {}
    for lines in LINES.values():
        for line in lines:
            u = direction(positions, *line)
            chord = np.linalg.norm(np.diff(u, axis=0), axis=-1)
            moved[line] = 2.0 * np.arcsin(np.clip(0.5 * chord, 0.0, 1.0))
    together = np.ones(len(positions) - 1, bool) if passes is None else passes[1:] == passes[:-1]
    count = 0
    for node, lines in LINES.items():
        step = angle_between(frames[1:, N[node]], frames[:-1, N[node]])
        most = np.max([moved[line] for line in lines], axis=0)
        with np.errstate(invalid="ignore"):
            count += int((together & (step > np.radians(45.0) + 3.0 * most)).sum())
    return count


def wave(rng, frames, size):
    """A smooth random curve within about plus and minus `size`."""
    t = np.arange(frames) / 30.0
    return size / 3.0 * sum(np.sin(2.0 * np.pi * f * t + rng.uniform(0, 7)) for f in rng.uniform(0.1, 1.0, 3))


def movement(rng, frames):
    """Smooth random movement through the full range of the joints, including straight knees and elbows."""
    q = standing(frames)
    q[:, 0] = from_euler(np.stack([wave(rng, frames, s) for s in (3.0, 0.5, 0.3)], axis=-1), "ZYX")
    q[:, N["spine"]] = from_euler(np.stack([wave(rng, frames, 0.4) for _ in range(3)], axis=-1), "ZYX")
    for side, out in (("left", 1.0), ("right", -1.0)):
        hip = [wave(rng, frames, 0.4), wave(rng, frames, 0.9) - 0.6, wave(rng, frames, 0.3)]
        q[:, N[f"hip_{side}"]] = from_euler(np.stack(hip, axis=-1), "ZYX")
        q[:, N[f"knee_{side}"]] = from_axis_angle("Y", np.abs(wave(rng, frames, 1.5)))
        raised = [wave(rng, frames, 0.8), wave(rng, frames, 1.4) - 1.0, out * (wave(rng, frames, 0.8) + 0.4)]
        q[:, N[f"shoulder_{side}"]] = from_euler(np.stack(raised, axis=-1), "ZYX")
        q[:, N[f"elbow_{side}"]] = from_axis_angle("Y", -np.abs(wave(rng, frames, 1.5)))
    return q


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), noise=st.sampled_from([0.0, 0.005, 0.02]))
def test_no_movement_of_a_body_flips_anything_with_and_without_noise(seed, noise):
    rng = np.random.default_rng(seed)
    p = positions_of(movement(rng, 240))
    assert flips(p + rng.normal(0.0, noise, p.shape)) == 0


def posed(t, turns):
    """A movement from the standing pose: node -> (axis, angle at the end in degrees), evenly."""
    q = standing(len(t))
    for node, parts in turns.items():
        for axis, degrees in parts:
            q[:, N[node]] = multiply(q[:, N[node]], from_axis_angle(axis, np.radians(degrees) * t))
    return q


MOVEMENTS = {
    "arms overhead by the side": {"shoulder_left": [("X", 175)], "shoulder_right": [("X", -175)]},
    "arms overhead by the front": {f"shoulder_{s}": [("Y", -175)] for s in ("left", "right")},
    "arms back": {f"shoulder_{s}": [("Y", 60)] for s in ("left", "right")},
    "arms crossed": {
        "shoulder_left": [("Y", -70), ("Z", -50)], "elbow_left": [("Y", -90)],
        "shoulder_right": [("Y", -60), ("Z", 50)], "elbow_right": [("Y", -100)],
    },
    "deep squat": {
        "spine": [("Y", 30)],
        **{f"hip_{s}": [("Y", -125)] for s in ("left", "right")},
        **{f"knee_{s}": [("Y", 140)] for s in ("left", "right")},
    },
    "lunge": {"hip_left": [("Y", -90)], "knee_left": [("Y", 90)], "hip_right": [("Y", 25)],
              "knee_right": [("Y", 80)]},
    "kneeling": {f"knee_{s}": [("Y", 150)] for s in ("left", "right")},
    "cross-legged": {
        "hip_left": [("Z", 60), ("Y", -80)], "knee_left": [("Y", 110)],
        "hip_right": [("Z", -60), ("Y", -80)], "knee_right": [("Y", 110)],
    },
    "bent down": {"hip_center": [("Y", 110)]},
}  # fmt: skip


@pytest.mark.parametrize("name", MOVEMENTS)
@pytest.mark.parametrize("noise", [0.0, 0.015])
def test_the_movements_of_exercises_flip_nothing_and_are_hinges(name, noise):
    t = np.concatenate([np.zeros(15), np.linspace(0, 1, 90), np.ones(15)])
    p = positions_of(posed(t, MOVEMENTS[name]))
    p += np.random.default_rng(1).normal(0.0, noise, p.shape)
    assert flips(p) == 0
    found = node_rotations(p)
    for joint in ("knee", "elbow"):
        for side in ("left", "right"):
            assert np.nanmax(np.abs(found[:, N[f"{joint}_{side}"]][:, [0, 2]])) < 1e-12
    if noise == 0.0:
        again = positions_of(found)
        assert np.linalg.norm(again - p, axis=-1).max() < 0.02


def test_a_turn_is_carried_across_the_straight_and_never_leaps():
    """A straight elbow shows no twist: the last one is kept until a bend shows another."""
    frames = 100
    sine = np.where(np.abs(np.arange(frames) - 50) < 20, 0.0, 0.5)
    seen = np.where(np.arange(frames) < 50, 0.4, 0.9)
    still = np.broadcast_to([[0.0, 0.0, -1.0], [0.1, 0.0, -1.0]], (frames, 2, 3)).copy()
    still[:, 1, 1] = 0.03 * np.arange(frames)
    turn = follow_twist(seen, sine, still)
    assert turn[:25] == pytest.approx(0.4, abs=0.02)
    assert turn[75:] == pytest.approx(0.9, abs=0.02)
    assert np.abs(np.diff(turn)).max() < 0.07


def test_what_is_seen_at_a_right_angle_is_kept_to_the_last_digit():
    rng = np.random.default_rng(0)
    seen = np.cumsum(rng.normal(0.0, 0.01, 200))
    moved = np.stack([np.cos(seen), np.sin(seen), np.zeros(200)], axis=-1)[:, None]
    assert follow_twist(seen, np.ones(200), moved) == pytest.approx(seen, abs=1e-9)


def test_a_gap_leaves_what_is_on_either_side():
    seen, sine = np.full(20, 0.3), np.full(20, 0.8)
    moved = np.tile([1.0, 0.0, 0.0], (20, 1, 1))
    seen[5:9] = np.nan
    turn = follow_twist(seen, sine, moved)
    assert np.isnan(turn[5:9]).all()
    assert np.delete(turn, range(5, 9)) == pytest.approx(0.3, abs=0.02)


CLEAN = (
    "cmu_bvh/02_01.bvh",
    "cmu_bvh/09_01.bvh",
    "cmu_asfamc/02_01.amc",
    "kinect2_vicon_uiprmd/vicon_m01_s01_e01_positions.txt.gz",
    "kinect2_vicon_uiprmd/kinect_m01_s02_e01_positions.txt.gz",
    "kinect1_bernstein_skl/micha_walk.skl",
    "kinect1_bernstein_skl/pd_1_a.skl",
    "kinect2_kimore/JointPositionExercise3.csv",
    "lab_opensim_gait/Hamner__subject02_running.trc",
    "kinect1_utkinect/joints_s01_e01.txt",
)


@pytest.mark.parametrize("name", CLEAN)
def test_real_recordings_flip_nothing(captures: Path, name: str):
    found = list(captures.rglob(Path(name).name))
    clip = check_capture(read(found[0])).clip
    assert flips(to_nodes(clip)[0], clip.passes) == 0
