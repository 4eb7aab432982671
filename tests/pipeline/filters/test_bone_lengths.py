"""Rigid bones have full weight; a joint that leaves its place loses its own and its neighbours'."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from samples.motion import in_sight, walk

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.filters.bone_lengths import (
    SHORTEST,
    TOLERANCE,
    bone_weights,
    joint_weights,
    rotation_weights,
)
from kinemimic.pipeline.filters.clean import clean
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import NODE_PARENTS, TRACKED, Skeleton, node_skeleton

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
    bones = bone_weights(in_sight(walk(FRAMES)).joints, NODE_PARENTS, PASS)
    assert bones[:, LEGS].min() > 1.0 - 1e-9
    # The sample's shoulders move on the trunk a little.
    assert bones.min() > 0.95


def test_a_change_of_length_halves_the_weight_and_only_there() -> None:
    bones = bone_weights(lifted(np.sqrt(3.0) * TOLERANCE), NODE_PARENTS, PASS)
    assert np.allclose(bones[40:43, KNEE], 0.5)
    assert (bones[40:43, ANKLE] < 0.95).all()
    elsewhere = np.delete(np.arange(FRAMES), np.arange(40, 43))
    assert bones[elsewhere][:, LEGS].min() > 1.0 - 1e-9
    assert bones[:, [HIP, FOOT]].min() == 1.0


def test_joints_and_rotations_take_the_least_of_their_bones() -> None:
    bones = bone_weights(lifted(0.3), NODE_PARENTS, PASS)
    joints, rotations = joint_weights(bones, NODE_PARENTS), rotation_weights(bones, NODE_PARENTS)
    assert np.allclose(joints[42, [HIP, KNEE, ANKLE]], [bones[42, KNEE], bones[42, KNEE], bones[42, ANKLE]])
    assert np.allclose(rotations[42, [HIP, KNEE, ANKLE]], [bones[42, KNEE], bones[42, ANKLE], 1.0])


def test_short_missing_and_outside_bones_have_full_weight() -> None:
    joints = lifted(0.3)
    joints[42, HIP] = np.nan
    passes = PASS.copy()
    passes[41] = -1
    bones = bone_weights(joints, NODE_PARENTS, passes)
    assert (bones[[41, 42], KNEE] == 1.0).all()
    assert bones[40, KNEE] < 0.2
    tiny = 0.9 * SHORTEST / np.median(np.linalg.norm(joints[:, KNEE] - joints[:, ANKLE], axis=-1))
    assert bone_weights(tiny * joints, NODE_PARENTS, PASS)[:, [KNEE, ANKLE]].min() == 1.0


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
