"""Rigid bones have full weight; a joint that leaves its place loses its own and its neighbours'."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from samples.motion import in_sight, walk

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.filters.bone_lengths import TOLERANCE, bone_weights
from kinemimic.pipeline.filters.clean import clean
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import TRACKED, Skeleton, node_skeleton

FRAMES = 90
PASS = np.zeros(FRAMES, dtype=np.int32)
LEGS = [N[f"{joint}_{side}"] for joint in ("knee", "ankle") for side in ("left", "right")]
HIP, KNEE, ANKLE, FOOT = (N[f"{joint}_left"] for joint in ("hip", "knee", "ankle", "foot"))


def lifted(share: float) -> Array:
    """The walk with the left knee moved up the thigh by this share of it, in frames 40 to 42."""
    joints = in_sight(walk(FRAMES)).joints.copy()
    joints[40:43, KNEE] += share * (joints[40:43, HIP] - joints[40:43, KNEE])
    return joints


def test_rigid_bones_have_full_weight() -> None:
    weights = bone_weights(in_sight(walk(FRAMES)).joints, node_skeleton(), PASS)
    for array in (weights.bones, weights.rotations, weights.positions):
        assert array[:, LEGS].min() > 1.0 - 1e-9
        # The sample's shoulders move on the trunk, so its upper arms are not quite rigid.
        assert array.min() > 0.95


def test_a_change_of_length_halves_the_weight_and_only_there() -> None:
    bones = bone_weights(lifted(np.sqrt(3.0) * TOLERANCE), node_skeleton(), PASS).bones
    assert np.allclose(bones[40:43, KNEE], 0.5)
    assert (bones[40:43, ANKLE] < 0.95).all()
    assert np.delete(bones, np.arange(40, 43), axis=0)[:, LEGS].min() > 1.0 - 1e-9
    assert np.delete(bones, (KNEE, ANKLE), axis=1).min() > 0.95


def test_joints_take_the_least_of_their_bones_and_the_trunk_none() -> None:
    weights = bone_weights(lifted(0.3), node_skeleton(), PASS)
    thigh, shank = weights.bones[42, [KNEE, ANKLE]]
    assert thigh < shank < 1.0
    assert weights.positions[42, [HIP, KNEE, ANKLE, FOOT]].tolist() == [1.0, thigh, shank, 1.0]
    assert weights.rotations[42, [HIP, KNEE, ANKLE]].tolist() == [thigh, shank, 1.0]


def test_missing_bones_and_frames_outside_passes_have_full_weight() -> None:
    joints = lifted(0.3)
    joints[42, HIP] = np.nan
    passes = PASS.copy()
    passes[41] = -1
    bones = bone_weights(joints, node_skeleton(), passes).bones
    assert (bones[[41, 42], KNEE] == 1.0).all()
    assert bones[40, KNEE] < 0.2
    assert bone_weights(np.full_like(joints, np.nan), node_skeleton(), PASS).positions.min() == 1.0


def test_a_knee_that_is_lost_for_three_frames_is_put_back() -> None:
    true = in_sight(walk(FRAMES))
    rng = np.random.default_rng(5)
    noise = rng.normal(0.0, 0.006, true.joints.shape)
    recorded = Clip(
        skeleton=node_skeleton(),
        times=true.times,
        positions=lifted(0.25) + noise,
        states=np.full(true.joints.shape[:2], TRACKED, dtype=np.uint8),
        passes=PASS,
    )
    cleaned, _ = clean(recorded, "kalman")
    # Without bones, the residuals alone decide what is an outlier.
    unweighed, _ = clean(replace(recorded, skeleton=loose()), "kalman")

    def error(clip: Clip) -> float:
        return float(np.linalg.norm(clip.positions[40:43, KNEE] - true.joints[40:43, KNEE], axis=-1).mean())

    assert error(recorded) > 0.10
    assert error(unweighed) > 0.08
    assert error(cleaned) < 0.04


def loose() -> Skeleton:
    """The 20 nodes, each a root of its own."""
    skeleton = node_skeleton()
    return replace(skeleton, parents=(-1,) * len(skeleton.parents))
