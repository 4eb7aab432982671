"""The 20 nodes from the joint names of several conventions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kinemimic.pipeline.captures import bvh as reader
from kinemimic.pipeline.captures.source import Source
from kinemimic.pipeline.clip import Clip
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.nodes import joints_of_nodes, normalised, to_nodes
from kinemimic.pipeline.skeleton import BONES, NODE_INDEX, NODES, Skeleton

Build = Callable[..., Clip]
Text = Callable[..., str]
PATH = Path("walk.bvh")


def test_names_lose_case_punctuation_and_namespace() -> None:
    assert normalised("mixamorig:LeftUpLeg") == "leftupleg"
    assert normalised("Upper_Leg.L") == "upperlegl"


CMU = "Hips LHipJoint LeftUpLeg LeftLeg LeftFoot LeftToeBase RightUpLeg RightLeg RightFoot RightToeBase "
CMU += "LowerBack Spine Spine1 Neck Neck1 Head Head_end LeftShoulder LeftArm LeftForeArm LeftHand "
CMU += "LeftHandIndex1 RightShoulder RightArm RightForeArm RightHand RightHandIndex1"
MIXAMO = "Hips Spine Spine1 Spine2 Neck Head HeadTop_End LeftShoulder LeftArm LeftForeArm LeftHand "
MIXAMO += "LeftHandMiddle1 RightShoulder RightArm RightForeArm RightHand RightHandMiddle1 LeftUpLeg LeftLeg "
MIXAMO += "LeftFoot LeftToeBase RightUpLeg RightLeg RightFoot RightToeBase"
BANDAI = (
    "joint_Root Hips Spine Chest Neck Head Shoulder_L UpperArm_L LowerArm_L Hand_L Shoulder_R UpperArm_R "
)
BANDAI += "LowerArm_R Hand_R UpperLeg_L LowerLeg_L Foot_L Toes_L UpperLeg_R LowerLeg_R Foot_R Toes_R"
POSER = (
    "Hips Chest LeftCollar LeftShoulder LeftElbow LeftWrist RightCollar RightShoulder RightElbow RightWrist "
)
POSER += "Neck Head LeftHip LeftKnee LeftAnkle LeftToe RightHip RightKnee RightAnkle RightToe"
KINECT2 = (
    "SpineBase SpineMid SpineShoulder Neck Head ShoulderLeft ElbowLeft WristLeft HandLeft ShoulderRight "
)
KINECT2 += (
    "ElbowRight WristRight HandRight HipLeft KneeLeft AnkleLeft FootLeft HipRight KneeRight AnkleRight "
)
KINECT2 += "FootRight"


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (CMU, "LeftUpLeg LeftLeg LeftFoot LeftToeBase LeftArm LeftForeArm LeftHand LeftHandIndex1 Neck"),
        (MIXAMO, "LeftUpLeg LeftLeg LeftFoot LeftToeBase LeftArm LeftForeArm LeftHand LeftHandMiddle1 Neck"),
        (BANDAI, "UpperLeg_L LowerLeg_L Foot_L Toes_L UpperArm_L LowerArm_L Hand_L - Neck"),
        (POSER, "LeftHip LeftKnee LeftAnkle LeftToe LeftShoulder LeftElbow LeftWrist - Neck"),
        (KINECT2, "HipLeft KneeLeft AnkleLeft FootLeft ShoulderLeft ElbowLeft WristLeft HandLeft "
         "SpineShoulder"),
        (" ".join(NODES), "hip_left knee_left ankle_left foot_left shoulder_left elbow_left wrist_left "
         "hand_left shoulder_center"),
    ],
)  # fmt: skip
def test_conventions(names: str, expected: str) -> None:
    joints = tuple(names.split())
    found = joints_of_nodes(joints)
    nodes = [
        f"{joint}_left" for joint in ("hip", "knee", "ankle", "foot", "shoulder", "elbow", "wrist", "hand")
    ]
    nodes.append("shoulder_center")
    assert [joints[found[n]] if n in found else "-" for n in nodes] == expected.split()
    # The other side is the same names with the side exchanged, and no joint serves twice.
    assert len(set(found.values())) == len(found)
    for node in nodes[:-1]:
        other = node.replace("left", "right")
        assert (node in found) == (other in found)
        if node in found:
            mirrored = (
                joints[found[node]].replace("Left", "Right").replace("left", "right").replace("_L", "_R")
            )
            assert joints[found[other]] == mirrored


def test_the_nodes_themselves(node_clip: Build) -> None:
    clip = node_clip()
    positions, states = to_nodes(clip)
    assert np.array_equal(positions, clip.positions)
    assert np.array_equal(states, clip.states)


def test_what_is_derived(bvh: Text) -> None:
    clip = reader.read(Source.of_text(bvh(), PATH))  # no clavicles, no fingers
    positions, states = to_nodes(clip)

    def at(node: str) -> np.ndarray:
        return positions[:, NODE_INDEX[node]]

    assert np.allclose(np.linalg.norm(at("hand_left") - at("wrist_left"), axis=-1), 0.08)
    forearm = at("wrist_left") - at("elbow_left")
    assert np.allclose(np.cross(forearm, at("hand_left") - at("wrist_left")), 0.0, atol=1e-12)
    assert (states[:, NODE_INDEX["hand_left"]] == 1).all()
    assert (states[:, NODE_INDEX["wrist_left"]] == 2).all()
    assert np.allclose(at("head"), clip.positions[:, clip.skeleton.index("Head_end")])


def test_without_a_neck_the_shoulders_give_their_centre(bvh: Text) -> None:
    clip = reader.read(Source.of_text(bvh().replace("JOINT Neck", "JOINT Throat"), PATH))
    positions, states = to_nodes(clip)
    arms = [clip.positions[:, clip.skeleton.index(f"{side}Arm")] for side in ("Left", "Right")]
    assert np.allclose(positions[:, NODE_INDEX["shoulder_center"]], 0.5 * (arms[0] + arms[1]))
    assert (states[:, NODE_INDEX["shoulder_center"]] == 1).all()


def rename(clip: Clip, old: str, new: str) -> Clip:
    names = tuple(new if name == old else name for name in clip.skeleton.names)
    return replace(clip, skeleton=Skeleton(names, clip.skeleton.parents, clip.skeleton.offsets))


def test_what_is_missing_is_named(node_clip: Build) -> None:
    with pytest.raises(KinemimicError, match="found none for knee_right among hip_center"):
        to_nodes(rename(node_clip(), "knee_right", "kn"))


def test_lengths_of_no_human_are_refused(node_clip: Build) -> None:
    clip = node_clip()
    with pytest.raises(
        KinemimicError, match=r"hip_left to knee_left between 0\.18 and 0\.65 m, found a median of 4"
    ):
        to_nodes(replace(clip, positions=10.0 * clip.positions))


@pytest.mark.parametrize("folder", ["cmu_bvh", "shum_gait_bvh", "bandai_bvh_ccbync", "kinect2_brekel_bvh"])
def test_real_bodies_have_human_bones(captures: Path, folder: str) -> None:
    for path in sorted((captures / folder).glob("*.bvh")):
        positions, states = to_nodes(reader.read(Source.open(path)))
        assert (states > 0).all()
        for start, end in BONES:
            bone = np.linalg.norm(positions[:, NODE_INDEX[end]] - positions[:, NODE_INDEX[start]], axis=-1)
            assert 0.03 < np.median(bone) < 0.52, (path.name, start, end)
        left, right = positions[:, NODE_INDEX["hip_left"]], positions[:, NODE_INDEX["hip_right"]]
        toes = positions[:, NODE_INDEX["foot_left"]] - positions[:, NODE_INDEX["ankle_left"]]
        # The pelvis' left crossed with up points where the toes do: nothing is mirrored.
        forward = np.cross(left - right, [0.0, 0.0, 1.0])
        assert np.median(np.sum(forward * toes, axis=-1)) > 0
