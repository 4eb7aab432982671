"""Joints are found by the names of several conventions and tools."""

from __future__ import annotations

import pytest

from kinemimic.pipeline.kinematics.joint_names import joints_by_name, normalised
from kinemimic.pipeline.kinematics.skeleton import NODES
from kinemimic.pipeline.readers.kinect.kinect_v2 import SDK_JOINTS


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
AZURE = "PELVIS SPINE_NAVEL SPINE_CHEST NECK "
for _side in ("LEFT", "RIGHT"):
    AZURE += " ".join(f"{joint}_{_side}" for joint in ("CLAVICLE", "SHOULDER", "ELBOW", "WRIST", "HAND"))
    AZURE += f" HANDTIP_{_side} THUMB_{_side} "
for _side in ("LEFT", "RIGHT"):
    AZURE += " ".join(f"{joint}_{_side}" for joint in ("HIP", "KNEE", "ANKLE", "FOOT")) + " "
AZURE += "HEAD NOSE EYE_LEFT EAR_LEFT EYE_RIGHT EAR_RIGHT"
UIPRMD = "Waist Spine Chest Neck Head HeadTip LCollar LUpperArm LForearm LHand RCollar RUpperArm RForearm "
UIPRMD += "RHand LUpperLeg LLowerLeg LFoot LToes RUpperLeg RLowerLeg RFoot RToes"
ASF = "root lhipjoint lfemur ltibia lfoot ltoes rhipjoint rfemur rtibia rfoot rtoes lowerback upperback "
ASF += "thorax lowerneck upperneck head lclavicle lhumerus lradius lwrist lhand lfingers lthumb rclavicle "
ASF += "rhumerus rradius rwrist rhand rfingers rthumb"
MAKEHUMAN = "root spine05 spine04 spine01 neck01 head "
for _side in "LR":
    MAKEHUMAN += " ".join(
        f"{bone}.{_side}"
        for bone in ("pelvis", "upperleg01", "upperleg02", "lowerleg01", "lowerleg02", "foot", "toe1-1")
    )
    MAKEHUMAN += f" clavicle.{_side} shoulder01.{_side} upperarm01.{_side} lowerarm01.{_side} wrist.{_side} "
# Genesis 8.
DAZ = "hip pelvis abdomenLower abdomenUpper chestLower chestUpper neckLower neckUpper head "
for _side in "lr":
    DAZ += (
        " ".join(
            _side + bone
            for bone in (
                "ThighBend",
                "ThighTwist",
                "Shin",
                "Foot",
                "Toe",
                "Collar",
                "ShldrBend",
                "ForearmBend",
                "Hand",
            )
        )
        + " "
    )
# VRChat's avatars, and SOMA of BONES-SEED: the thigh is the leg.
VRCHAT = "Hips Spine Chest Neck Head "
SOMA = "Root Hips Spine1 Spine2 Chest Neck1 Neck2 Head "
for _side in ("Left", "Right"):
    VRCHAT += " ".join(
        f"{_side}_{joint}" for joint in ("leg", "knee", "ankle", "toe", "shoulder", "arm", "elbow", "wrist")
    )
    SOMA += " ".join(
        f"{_side}{bone}"
        for bone in ("Shoulder", "Arm", "ForeArm", "Hand", "HandMiddle1", "Leg", "Shin", "Foot", "ToeBase")
    )
    VRCHAT, SOMA = f"{VRCHAT} ", f"{SOMA} "
CASCADEUR = "pelvis stomach chest neck head "
for _side in "lr":
    CASCADEUR += " ".join(
        f"{bone}_{_side}" for bone in ("thigh", "calf", "foot", "toe", "clavicle", "arm", "forearm", "hand")
    )
    CASCADEUR += " "
# Of Talking With Hands.
TWH = "body_world b_root b_spine0 b_neck0 b_head "
for _side in "lr":
    TWH += " ".join(
        f"b_{_side}_{bone}"
        for bone in ("upleg", "leg", "foot", "shoulder", "arm", "arm_twist", "forearm", "wrist")
    )
    TWH += " "
OPENSIM = "pelvis femur_r tibia_r patella_r talus_r calcn_r toes_r femur_l tibia_l patella_l talus_l calcn_l "
OPENSIM += "toes_l torso humerus_r ulna_r radius_r hand_r humerus_l ulna_l radius_l hand_l"


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (CMU, "LeftUpLeg LeftLeg LeftFoot LeftToeBase LeftArm LeftForeArm LeftHand LeftHandIndex1 Neck"),
        (MIXAMO, "LeftUpLeg LeftLeg LeftFoot LeftToeBase LeftArm LeftForeArm LeftHand LeftHandMiddle1 Neck"),
        (BANDAI, "UpperLeg_L LowerLeg_L Foot_L Toes_L UpperArm_L LowerArm_L Hand_L - Neck"),
        (POSER, "LeftHip LeftKnee LeftAnkle LeftToe LeftShoulder LeftElbow LeftWrist - Neck"),
        (KINECT2, "HipLeft KneeLeft AnkleLeft FootLeft ShoulderLeft ElbowLeft WristLeft HandLeft "
         "SpineShoulder"),
        (" ".join(SDK_JOINTS), "HipLeft KneeLeft AnkleLeft FootLeft ShoulderLeft ElbowLeft WristLeft "
         "HandLeft SpineShoulder"),
        (AZURE, "HIP_LEFT KNEE_LEFT ANKLE_LEFT FOOT_LEFT SHOULDER_LEFT ELBOW_LEFT WRIST_LEFT HAND_LEFT NECK"),
        (UIPRMD, "LUpperLeg LLowerLeg LFoot LToes LUpperArm LForearm LHand - Neck"),
        (ASF, "lfemur ltibia lfoot ltoes lhumerus lradius lwrist lhand lowerneck"),
        (MAKEHUMAN, "upperleg01.L lowerleg01.L foot.L toe1-1.L upperarm01.L lowerarm01.L wrist.L - neck01"),
        (DAZ, "lThighBend lShin lFoot lToe lShldrBend lForearmBend lHand - neckLower"),
        (VRCHAT, "Left_leg Left_knee Left_ankle Left_toe Left_arm Left_elbow Left_wrist - Neck"),
        (SOMA, "LeftLeg LeftShin LeftFoot LeftToeBase LeftArm LeftForeArm LeftHand LeftHandMiddle1 Neck1"),
        (CASCADEUR, "thigh_l calf_l foot_l toe_l arm_l forearm_l hand_l - neck"),
        (TWH, "b_l_upleg b_l_leg b_l_foot - b_l_arm b_l_forearm b_l_wrist - b_neck0"),
        (" ".join(NODES), "hip_left knee_left ankle_left foot_left shoulder_left elbow_left wrist_left "
         "hand_left shoulder_center"),
    ],
)  # fmt: skip
def test_conventions(names: str, expected: str) -> None:
    joints = tuple(names.split())
    found = joints_by_name(joints)
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
            name = joints[found[node]]
            words = (
                ("LEFT", "RIGHT"), ("Left", "Right"), ("left", "right"), ("_L", "_R"), (".L", ".R"),
                ("_l", "_r"),
            )  # fmt: skip
            word = next(
                (pair for pair in words if pair[0] in name), (name[0], {"L": "R", "l": "r"}.get(name[0]))
            )
            assert joints[found[other]] == name.replace(*word, 1)


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (KINECT2, "SpineBase SpineMid SpineShoulder Head"),
        (AZURE, "PELVIS SPINE_NAVEL NECK HEAD"),
        (UIPRMD, "Waist Spine Neck HeadTip"),
        (ASF, "root lowerback lowerneck head"),
    ],
)
def test_the_trunk_of_each_convention(names: str, expected: str) -> None:
    joints = tuple(names.split())
    found = joints_by_name(joints)
    assert [joints[found[node]] for node in ("hip_center", "spine", "shoulder_center", "head")] == (
        expected.split()
    )


def test_the_feet_of_keypoints() -> None:
    for joints in (
        ("LAnkle", "LHeel", "LBigToe", "LSmallToe"),
        ("left_ankle", "left_heel", "left_foot_index"),
    ):
        assert joints_by_name(joints) == {"ankle_left": 0, "foot_left": 2}


def test_a_part_of_the_pelvis_beside_a_thigh_is_no_hip() -> None:
    joints = ("hips", *(f"{bone}.{s}" for s in "LR" for bone in ("hip", "thigh", "shin", "foot")))
    assert joints[joints_by_name(joints)["hip_left"]] == "thigh.L"
    joints = ("Root_M", *(f"{joint}_{s}" for s in "LR" for joint in ("Hip", "Knee", "Ankle")))
    assert joints[joints_by_name(joints)["hip_left"]] == "Hip_L"


def test_the_bodies_of_opensim() -> None:
    joints = tuple(OPENSIM.split())
    found = {node: joints[index] for node, index in joints_by_name(joints).items()}
    legs = ("hip", "knee", "ankle", "foot")
    assert [found[f"{joint}_left"] for joint in legs] == ["femur_l", "tibia_l", "talus_l", "toes_l"]
    assert [found[f"{joint}_right"] for joint in ("shoulder", "elbow", "wrist")] == [
        "humerus_r",
        "ulna_r",
        "hand_r",
    ]
    assert (found["hip_center"], found["spine"]) == ("pelvis", "torso")


@pytest.mark.parametrize(
    ("hips", "thigh", "shank", "foot", "forearm"),
    [
        ("Bip01_Pelvis", "Bip01_*_Thigh", "Bip01_*_Calf", "Bip01_*_Foot", "Bip01_*_Forearm"),
        ("Bip001 Pelvis", "Bip001 * Thigh", "Bip001 * Calf", "Bip001 * Foot", "Bip001 * Forearm"),
        (
            "Bob:Bip01 Pelvis",
            "Bob:Bip01 * Thigh",
            "Bob:Bip01 * Calf",
            "Bob:Bip01 * Foot",
            "Bob:Bip01 * Forearm",
        ),
        ("mixamorig_Hips", "mixamorig_*UpLeg", "mixamorig_*Leg", "mixamorig_*Foot", "mixamorig_*ForeArm"),
        ("mixamorigHips", "mixamorig*UpLeg", "mixamorig*Leg", "mixamorig*Foot", "mixamorig*ForeArm"),
        ("Skeleton_Hip", "Skeleton_*Thigh", "Skeleton_*Shin", "Skeleton_*Foot", "Skeleton_*FArm"),
        ("DEF-hips", "DEF-thigh.*", "DEF-shin.*", "DEF-foot.*", "DEF-forearm.*"),
        ("J_Bip_C_Hips", "J_Bip_*_UpperLeg", "J_Bip_*_LowerLeg", "J_Bip_*_Foot", "J_Bip_*_LowerArm"),
        ("CC_Base_Hip", "CC_Base_*_Thigh", "CC_Base_*_Calf", "CC_Base_*_Foot", "CC_Base_*_Forearm"),
        ("Root_M", "Hip_*", "Knee_*", "Ankle_*", "Elbow_*"),
    ],
)
def test_what_a_tool_puts_before_every_name(
    hips: str, thigh: str, shank: str, foot: str, forearm: str
) -> None:
    # A scene's own nodes have other prefixes, or none.
    joints = ("Scene", hips, *(name.replace("*", s) for s in "LR" for name in (thigh, shank, foot, forearm)))
    joints += tuple(f"J_Sec_Hair{k}" for k in range(7))
    found = joints_by_name(joints)
    for k, node in enumerate(("hip", "knee", "ankle", "elbow")):
        assert (found[f"{node}_left"], found[f"{node}_right"]) == (2 + k, 6 + k)
    assert found["hip_center"] == 1


@pytest.mark.parametrize(
    "pattern", ["*_upleg_JNT *_leg_JNT *_foot_JNT", "*_thigh_jnt *_shank_jnt *_foot_jnt",
                "Rig_*_UpLegJoint Rig_*_LegJoint Rig_*_FootJoint"],
)  # fmt: skip
def test_what_a_tool_puts_behind_every_name(pattern: str) -> None:
    joints = tuple(name.replace("*", side) for side in "lr" for name in pattern.split())
    found = joints_by_name((*joints, "spine", "lth", "rth"))
    assert [found[f"{joint}_{side}"] for side in ("left", "right") for joint in ("hip", "knee", "ankle")] == [
        0, 1, 2, 3, 4, 5,
    ]  # fmt: skip
