from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kinemimic.pipeline.kinematics.clip import Clip, forward_kinematics
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.kinematics.orientation.rest_pose import node_rotations_of
from kinemimic.pipeline.kinematics.rotations import (
    angle_between,
    conjugate,
    continuous,
    from_axis_angle,
    from_euler,
    multiply,
    rotate,
    to_rotvec,
)
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import NODE_PARENTS, NODES, Skeleton
from kinemimic.pipeline.readers.mocap.deepmimic import read_deepmimic, stock_motion
from kinemimic.pipeline.readers.recognise import read

BODIES = [N[name] for name in NODES if name.split("_")[0] not in ("head", "hand", "foot")]


def reposed(clip: Clip, seed: int, largest: float) -> Clip:
    """The same motion on a skeleton with other joint frames: those of another rest pose.

    Each joint's frame is turned by a constant of its own, W_j -> W_j C_j; places stay where they are.
    """
    joints = len(clip.skeleton.names)
    turns = from_euler(np.random.default_rng(seed).uniform(-largest, largest, (joints, 3)), "ZYX")
    assert clip.rotations is not None
    parents = np.array(clip.skeleton.parents)
    above = np.where((parents < 0)[:, None], [0.0, 0.0, 0.0, 1.0], turns[parents])
    local = multiply(multiply(conjugate(above), clip.rotations), turns)
    skeleton = Skeleton(
        clip.skeleton.names, clip.skeleton.parents, rotate(conjugate(above), clip.skeleton.offsets)
    )
    return replace(clip, skeleton=skeleton, rotations=continuous(local))


def foreign(clip: Clip) -> Clip:
    """A clip of the nodes under a mocap library's joint names, so that its frames are not taken for ours."""
    names = tuple(
        {"hip_center": "Hips", "spine": "Spine", "shoulder_center": "Neck", "head": "HeadEnd"}.get(name)
        or {
            "shoulder": "{}Arm", "elbow": "{}ForeArm", "wrist": "{}Hand", "hand": "{}HandEnd",
            "hip": "{}UpLeg", "knee": "{}Leg", "ankle": "{}Foot", "foot": "{}Toes",
        }[name.split("_")[0]].format(name.split("_")[1].capitalize())
        for name in NODES
    )  # fmt: skip
    return replace(clip, skeleton=replace(clip.skeleton, names=names))


@pytest.fixture(scope="module")
def walk() -> Clip:
    return read_deepmimic(stock_motion("walk"))


def test_a_motion_on_our_own_skeleton_keeps_its_rotations(walk):
    found = node_rotations_of(walk)
    assert angle_between(found.rotations, walk.rotations)[:, BODIES].max() < 1e-6
    assert max(found.off_axis.values()) < 1e-6


def test_rest_poses_do_not_matter(walk):
    """A T-pose, an A-pose, a sensor's axes: the same motion gives the same rotations."""
    plain = node_rotations_of(foreign(walk))
    for seed, largest in ((0, 0.8), (1, np.pi)):
        other = node_rotations_of(reposed(foreign(walk), seed, largest))
        assert other.sources == plain.sources
        assert angle_between(other.rotations, plain.rotations).max() < 1e-6


def test_another_skeleton_s_rotations_are_found_again(walk):
    """The stock walk under other names: its positions determine every constant rotation to a few degrees."""
    found = node_rotations_of(foreign(walk)).rotations
    apart = np.degrees(angle_between(found, walk.rotations))
    for node in ("hip_center", "spine", "hip_left", "hip_right", "knee_left", "knee_right", "elbow_left"):
        assert apart[:, N[node]].max() < 3.0, node


def test_a_recorded_turn_that_no_position_shows_is_kept(walk):
    """A head that looks from side to side."""
    t = np.linspace(0.0, 2.0 * np.pi, len(walk.times))
    turned = walk.rotations.copy()
    turned[:, N["shoulder_center"]] = from_axis_angle("Z", 0.6 * np.sin(t))
    clip = foreign(replace(walk, rotations=turned))
    found = node_rotations_of(clip).rotations[:, N["shoulder_center"]]
    yaw = to_rotvec(found)[:, 2]  # of q and -q alike
    assert np.ptp(yaw) == pytest.approx(1.2, abs=0.02)


def test_knees_and_elbows_are_hinges_and_the_rest_is_told(walk):
    bent = walk.rotations.copy()
    elbow = N["elbow_left"]
    bent[:, elbow] = multiply(bent[:, elbow], from_axis_angle("Z", 0.5))  # a forearm's pronation
    clip = foreign(replace(walk, rotations=bent))
    found = node_rotations_of(clip)
    for node in ("knee_left", "knee_right", "elbow_left", "elbow_right"):
        assert np.abs(found.rotations[:, N[node]][:, [0, 2]]).max() < 1e-9
    assert set(found.off_axis) == {"knee_left", "knee_right", "elbow_left", "elbow_right"}
    assert found.off_axis["knee_left"] < np.radians(1.0)


def test_rotations_that_contradict_the_positions_are_left_alone(walk):
    wild = np.random.default_rng(0).normal(size=walk.rotations.shape)
    clip = foreign(replace(walk, rotations=continuous(wild / np.linalg.norm(wild, axis=-1, keepdims=True))))
    found = node_rotations_of(clip)
    assert not {"hip_left", "knee_left", "shoulder_right"} & found.sources.keys()
    assert np.isfinite(found.rotations).all()


def test_positions_come_back_by_forward_kinematics(captures: Path):
    """A CMU clip on the node skeleton with the subject's bone lengths: joint positions are unchanged."""
    clip = read(captures / "cmu_bvh" / "02_01.bvh")
    positions = to_nodes(clip)[0]
    found = node_rotations_of(clip).rotations
    frames = forward_kinematics(
        Skeleton(NODES, NODE_PARENTS, np.zeros((20, 3))), np.zeros((*found.shape[:2], 3)), found
    )[1]
    bones = positions - positions[:, NODE_PARENTS]
    offsets = np.median(rotate(conjugate(frames[:, NODE_PARENTS]), bones), axis=0)
    offsets[0] = 0.0
    translations = np.broadcast_to(offsets, positions.shape).copy()
    translations[:, 0] = positions[:, 0]
    again = forward_kinematics(Skeleton(NODES, NODE_PARENTS, offsets), translations, found)[0]
    error = np.linalg.norm(again - positions, axis=-1)
    legs = [N[f"{joint}_{side}"] for joint in ("hip", "knee", "ankle", "foot") for side in ("left", "right")]
    assert error[:, legs].max() < 0.005
    assert np.median(error) < 0.005
    assert error.max() < 0.05  # clavicles move the shoulders, which the body's rigid torso does not


def test_bvh_and_amc_of_one_take_agree(captures: Path):
    """Legs agree exactly; hands follow different joints of the two skeletons."""
    bvh, amc = (
        node_rotations_of(read(captures / folder / name)).rotations
        for folder, name in (("cmu_bvh", "02_01.bvh"), ("cmu_asfamc", "02_01.amc"))
    )
    apart = np.degrees(angle_between(bvh, amc))
    for node in (
        "hip_center",
        "hip_left",
        "hip_right",
        "knee_left",
        "knee_right",
        "ankle_left",
        "ankle_right",
    ):
        assert apart[:, N[node]].max() < 0.01, node
    for node in ("spine", "shoulder_left", "shoulder_right", "elbow_left", "elbow_right"):
        assert apart[:, N[node]].max() < 1.0, node


def test_a_laboratory_s_knees_are_hinges_already(captures: Path):
    off = node_rotations_of(read(captures / "cmu_asfamc" / "02_01.amc")).off_axis
    assert max(off.values()) < np.radians(0.1)
