from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from samples.bouts import bouts_of

from kinemimic.pipeline.convert import convert, on_nodes
from kinemimic.pipeline.gait.normative import normative_band
from kinemimic.pipeline.ingest import ingest
from kinemimic.pipeline.kinematics.rotations import IDENTITY, from_axis_angle, rotate, to_rotvec
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import NODES
from kinemimic.retarget.cyclic import fit_cyclic
from kinemimic.retarget.feet.ankles import FOOT_FLAT, normal_feet
from kinemimic.retarget.feet.contact import sole_positions
from kinemimic.retarget.feet.legs import FEET_ADJACENT, MIN_CLEARANCE, neutral_feet
from kinemimic.retarget.feet.scale import body_kinematics
from kinemimic.retarget.strides.selection import select_bouts

PHASE = np.arange(120) / 120.0


def normal_walk(knee: float = 1.0, lean: float = 0.0):
    """A walk with the hips and, times `knee`, the knees of normal walking; lean: radians of the pelvis."""
    rotations = np.tile(IDENTITY, (len(PHASE), len(NODES), 1))
    rotations[:, 0] = from_axis_angle("Y", np.full(len(PHASE), lean))
    for side, shift in (("left", 0.0), ("right", 0.5)):
        rotations[:, N[f"hip_{side}"]] = from_axis_angle("Y", -normative_band("hip", PHASE + shift)[0])
        rotations[:, N[f"knee_{side}"]] = from_axis_angle(
            "Y", knee * normative_band("knee", PHASE + shift)[0]
        )
    return rotations


def flexion(rotations, side):
    """Dorsiflexion of the ankle."""
    return -to_rotvec(rotations[:, N[f"ankle_{side}"]])[:, 1]


def test_a_normal_walk_gets_the_normative_ankle_up_to_a_constant():
    walked = normal_feet(normal_walk(), PHASE)
    for side, shift in (("left", 0.0), ("right", 0.5)):
        apart = flexion(walked, side) - normative_band("ankle", PHASE + shift)[0]
        assert np.ptp(apart[np.mod(PHASE + shift, 1.0) < 0.6]) < 1e-9
        assert np.degrees(np.abs(apart).max()) < 8


def test_the_sole_is_flat_in_mid_stance_for_any_lean_of_the_pelvis():
    for lean in (0.0, 0.15):
        frames = body_kinematics(normal_feet(normal_walk(lean=lean), PHASE))[1]
        for side, shift in (("left", 0.0), ("right", 0.5)):
            toe = rotate(frames[:, N[f"ankle_{side}"]], np.array([1.0, 0.0, 0.0]))
            stride = np.mod(PHASE + shift, 1.0)
            pitch = np.degrees(np.arcsin(toe[(stride > FOOT_FLAT[0]) & (stride < FOOT_FLAT[1]), 2]))
            assert abs(pitch.mean()) < 0.5
            assert np.abs(pitch).max() < 8


def test_toes_are_lifted_if_the_knee_bends_too_little_in_swing():
    def clearance(rotations):
        low = sole_positions(*body_kinematics(rotations))[..., 2].min(axis=-1)
        start, end = FEET_ADJACENT
        swings = (start < PHASE) & (end > PHASE)
        return (low[swings, 0] - low[swings, 1]).min()

    stiff = normal_walk(knee=0.8)
    assert clearance(normal_feet(stiff, PHASE)) > 0.8 * MIN_CLEARANCE
    assert clearance(normal_feet(normal_walk(), PHASE)) > 0.8 * MIN_CLEARANCE


@pytest.mark.parametrize("name", ["02_01.bvh", "02_02.bvh", "07_01.bvh"])
def test_a_normative_ankle_is_nearer_to_the_measured_one_than_a_neutral_one(
    tmp_path: Path, captures: Path, name: str
):
    """Optical walks, whose feet are seen: the normative ankles against the measured ones."""
    ingest(captures / "cmu_bvh" / name, tmp_path)
    clip = on_nodes(convert(tmp_path))
    motion = fit_cyclic(clip, select_bouts(bouts_of(clip)).bouts).motion
    phase = np.arange(len(motion.root)) / len(motion.root)

    def error(made):
        apart = [flexion(made, side) - flexion(motion.rotations, side) for side in ("left", "right")]
        return float(np.degrees(np.sqrt(np.mean(np.square(apart)))))

    normal = error(normal_feet(motion.rotations, phase))
    assert normal < 10.0
    assert normal < 0.75 * error(neutral_feet(motion.rotations, phase))
