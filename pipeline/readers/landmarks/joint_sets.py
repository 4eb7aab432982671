"""The joint sets of sensors, networks and data sets that give joints as one array, told apart by the body
they show.

An array has no names, and several sets have as many joints. In the right order, the bones of the limbs keep
their lengths, left and right ones are alike, and arms, trunk and legs have a person's proportions.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.joint_names import joints_by_name
from kinemimic.pipeline.kinematics.joints_by_tree import is_a_person
from kinemimic.pipeline.kinematics.rotations import IDENTITY, Y_UP_TO_Z_UP
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODE_PARENTS, NODES
from kinemimic.pipeline.readers.kinect.azure_joints import AZURE_JOINTS, WORLD_FROM_CAMERA
from kinemimic.pipeline.readers.kinect.kinect_v2 import SDK_JOINTS
from kinemimic.pipeline.readers.landmarks.blaze_pose import LANDMARKS, OF_NODE
from kinemimic.pipeline.readers.landmarks.zed_json import POINTS
from kinemimic.pipeline.readers.segments.smpl_clip import JOINTS as SMPL_22

# Frames, spread over the recording, in which bones are measured.
_SAMPLE_FRAMES = 200
# Largest error of a body (`_error`): bones that a network finds vary by a tenth, wrong ones by half or more.
_LARGEST_ERROR = 0.3
_SIDES = ("left", "right")
_LIMBS = tuple(f"{joint}_{side}" for joint in ("elbow", "wrist", "knee", "ankle") for side in _SIDES)


@dataclass(frozen=True)
class JointSet:
    """name: usual one; world_from_file: (4,) rotation from the usual axes of such arrays to ours; rate: their
    usual frame rate, Hz; also: joints in whose middle a node is, where its name does not say so."""

    name: str
    joints: tuple[str, ...]
    world_from_file: Array
    rate: float = 30.0
    also: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @cached_property
    def nodes(self) -> dict[str, list[int]]:
        """The joints in whose middle every node is that the set shows."""
        named = {node: [joint] for node, joint in joints_by_name(self.joints).items()}
        return named | {
            node: [self.joints.index(name) for name in names] for node, names in self.also.items()
        }


def places(points: Array, joint_set: JointSet) -> dict[str, Array]:
    """Node -> its places (T, 3) in points (T, J, 3)."""
    return {node: points[:, joints].mean(axis=1) for node, joints in joint_set.nodes.items()}


def _of_points(numbers: Mapping[str, int], count: int) -> tuple[str, ...]:
    """The names of as many points, of which these are nodes."""
    nodes = {number: node for node, number in numbers.items()}
    return tuple(nodes.get(number, f"point_{number}") for number in range(count))


def _sided(*joints: str, first: str) -> tuple[str, ...]:
    sides = (first, "right" if first == "left" else "left")
    return tuple(f"{side}_{joint}" for joint in joints for side in sides)


# Order of Human3.6M's 17 joints in VideoPose3D and its successors (MotionBERT, MMPose).
_HUMAN36M: tuple[str, ...] = (
    "pelvis",
    *(f"{side}_{joint}" for side in ("right", "left") for joint in ("hip", "knee", "ankle")),
    "spine", "neck", "nose", "head",
    *(f"{side}_{joint}" for side in ("left", "right") for joint in ("shoulder", "elbow", "wrist")),
)  # fmt: skip
# All 32 of Human3.6M: some twice, and the ends of chains.
_HUMAN36M_ALL: tuple[str, ...] = (
    "pelvis",
    *(f"right_{joint}" for joint in ("hip", "knee", "ankle", "toes", "toes_end")),
    *(f"left_{joint}" for joint in ("hip", "knee", "ankle", "toes", "toes_end")),
    "pelvis_again", "spine", "neck", "nose", "head",
    "neck_left", *(f"left_{joint}" for joint in ("shoulder", "elbow", "wrist", "wrist_again", "thumb")),
    "left_fingers", "left_fingers_end",
    "neck_right", *(f"right_{joint}" for joint in ("shoulder", "elbow", "wrist", "wrist_again", "thumb")),
    "right_fingers", "right_fingers_end",
)  # fmt: skip
_COCO: tuple[str, ...] = (
    "nose",
    *_sided("eye", "ear", "shoulder", "elbow", "wrist", "hip", "knee", "ankle", first="left"),
)
# OpenPose's BODY_25, triangulated or lifted.
_BODY_25: tuple[str, ...] = (
    "nose", "neck",
    *(f"{side}_{joint}" for side in ("right", "left") for joint in ("shoulder", "elbow", "wrist")),
    "pelvis",
    *(f"{side}_{joint}" for side in ("right", "left") for joint in ("hip", "knee", "ankle")),
    *_sided("eye", "ear", first="right"),
    *(f"{side}_{part}" for side in ("left", "right") for part in ("big_toe", "small_toe", "heel")),
)  # fmt: skip
# A Kinect v1's as the Multimodal Human Action Dataset of the University of Texas at Dallas has them.
_UTD_MHAD: tuple[str, ...] = (
    "head", "shoulder_center", "spine", "hip_center",
    *(f"{joint}_{side}" for side in _SIDES for joint in ("shoulder", "elbow", "wrist", "hand")),
    *(f"{joint}_{side}" for side in _SIDES for joint in ("hip", "knee", "ankle", "foot")),
)  # fmt: skip
# Of the KIT Motion-Language data set, as text-to-motion networks have it: middle and end of each foot.
_KIT_ML: tuple[str, ...] = (
    "pelvis", "spine", "chest", "neck", "head",
    *(f"{side}_{joint}" for side in ("right", "left") for joint in ("shoulder", "elbow", "wrist")),
    *(f"{side}_{joint}" for side in ("right", "left") for joint in ("hip", "knee", "ankle", "arch", "toes")),
)  # fmt: skip
_SMPL_24 = (*SMPL_22, "left_hand", "right_hand")
# COCO's body with feet, a face and hands.
_WHOLE_BODY: tuple[str, ...] = (
    *_COCO,
    *(f"{side}_{part}" for side in _SIDES for part in ("big_toe", "small_toe", "heel")),
    *(f"point_{k}" for k in range(23, 133)),
)
_HALPE_26: tuple[str, ...] = (
    *_COCO, "head", "neck", "pelvis", *_sided("big_toe", "small_toe", "heel", first="left"),
)  # fmt: skip
# Momentum's human rig, as SAM 3D Body gives it: the wrists behind the fingers of their hand.
_MHR_70: tuple[str, ...] = (
    *_COCO[:9], *_sided("hip", "knee", "ankle", first="left"),
    *(f"{side}_{part}" for side in _SIDES for part in ("big_toe", "small_toe", "heel")),
    *(f"right_finger_{k}" for k in range(20)), "right_wrist",
    *(f"left_finger_{k}" for k in range(20)), "left_wrist",
    *(f"point_{k}" for k in range(63, 69)), "neck",
)  # fmt: skip
_HEAD = {"head": OF_NODE["head"]}  # COCO and OpenPose call the ears as MediaPipe does
_TOES = {f"foot_{side}": (f"{side}_big_toe",) for side in _SIDES}
KINECT_V1 = JointSet("Kinect v1", NODES, Y_UP_TO_Z_UP)
KINECT_V2 = JointSet("Kinect v2", SDK_JOINTS, Y_UP_TO_Z_UP)
AZURE_KINECT = JointSet("Azure Kinect", AZURE_JOINTS, WORLD_FROM_CAMERA)
MEDIAPIPE = JointSet("MediaPipe", LANDMARKS, WORLD_FROM_CAMERA, also=OF_NODE)
SETS: tuple[JointSet, ...] = (
    JointSet("Human3.6M, 17 joints", _HUMAN36M, WORLD_FROM_CAMERA),
    JointSet("COCO, 17 keypoints", _COCO, WORLD_FROM_CAMERA, also=_HEAD),
    KINECT_V1,
    JointSet("UTD-MHAD, 20 joints", _UTD_MHAD, Y_UP_TO_Z_UP),
    # HumanML3D's, and what is generated in its form.
    JointSet("SMPL, 22 joints", SMPL_22, Y_UP_TO_Z_UP, rate=20.0),
    JointSet("SMPL, 24 joints", _SMPL_24, Y_UP_TO_Z_UP),
    JointSet("KIT-ML, 21 joints", _KIT_ML, Y_UP_TO_Z_UP, rate=12.5),
    KINECT_V2,
    JointSet(
        "OpenPose BODY_25", _BODY_25, WORLD_FROM_CAMERA, also={**_HEAD, **_TOES},
    ),
    AZURE_KINECT,
    JointSet(
        "Human3.6M, 32 joints", _HUMAN36M_ALL, IDENTITY, rate=50.0,
        also={f"{node}_{side}": (f"{side}_{joint}",)
              for node, joint in (("foot", "toes"), ("hand", "fingers")) for side in _SIDES},
    ),
    MEDIAPIPE,
    JointSet("COCO-WholeBody, 133 keypoints", _WHOLE_BODY, WORLD_FROM_CAMERA, also={**_HEAD, **_TOES}),
    JointSet("Halpe, 26 keypoints", _HALPE_26, WORLD_FROM_CAMERA, also=_TOES),
    JointSet("SAM 3D Body, 70 keypoints", _MHR_70, WORLD_FROM_CAMERA, also={**_HEAD, **_TOES}),
    # OpenPose's COCO, too, has these 18.
    *(JointSet(f"ZED, {count} points", _of_points(points, count), WORLD_FROM_CAMERA)
      for count, points in POINTS.items()),
    # FreeMoCap's, of MediaPipe's body, hands and face.
    JointSet("MediaPipe, body, hands and face",
             (*LANDMARKS, *(f"point_{k}" for k in range(len(LANDMARKS), 553))), IDENTITY, also=OF_NODE),
)  # fmt: skip
COUNTS: frozenset[int] = frozenset(len(joint_set.joints) for joint_set in SETS)
# Numbers of a joint, without and with how sure it is; width of a row of all joints -> the numbers of each (96
# are the places of an Azure Kinect, rather than SMPL's with a confidence).
FIELDS = (3, 4)
# KIT-ML's are never in rows, where 84 numbers are a Kinect's 20 joints and four more.
FIELDS_OF_ROW: dict[int, int] = {
    fields * joints: fields for fields in reversed(FIELDS) for joints in COUNTS - {len(_KIT_ML)}
}


def joint_set_of(points: Array) -> JointSet | None:
    """The set of as many joints whose order makes a body of points (T, J, 3); None if none does."""
    found = [
        (_error(points, joint_set), joint_set)
        for joint_set in SETS
        if len(joint_set.joints) == points.shape[1]
    ]
    error, best = min(found, key=lambda pair: pair[0])
    return best if error <= _LARGEST_ERROR else None


def fits(points: Array, joint_set: JointSet) -> bool:
    """Whether points (T, J, 3) in the order of a set make a body."""
    return _error(points, joint_set) <= _LARGEST_ERROR


def _error(points: Array, joint_set: JointSet) -> float:
    """Mean over the limbs' bones of the variation of their lengths, and of the difference between the sides,
    as shares of the lengths; infinity if a bone is never seen, for a pelvis that is not at the hips, and for
    proportions that are not a person's."""
    nodes = places(points[:: len(points) // _SAMPLE_FRAMES + 1], joint_set)
    medians, variations = [], []
    for limb in _LIMBS:
        parent = NODES[NODE_PARENTS[NODE_INDEX[limb]]]
        with np.errstate(over="ignore", invalid="ignore"):  # a damaged file may hold any number
            lengths = np.linalg.norm(nodes[limb] - nodes[parent], axis=-1)
        lengths = lengths[np.isfinite(lengths)]
        if not len(lengths) or not (median := float(np.median(lengths))) > 0.0:
            return np.inf
        medians.append(median)
        variations.append(float(np.median(np.abs(lengths - median))) / median)
    left, right = np.array(medians[::2]), np.array(medians[1::2])
    if not _pelvis_at_hips(nodes) or not _is_a_person(nodes, 0.5 * (left + right)):
        return np.inf
    return float(np.mean(variations) + np.mean(np.abs(left - right) / np.maximum(left, right)))


def _is_a_person(nodes: Mapping[str, Array], bones: Array) -> bool:
    """Whether arms, trunk and legs are as long as a person's, relative to each other.

    bones: lengths (4,) of upper arm, forearm, thigh and shank. Any numbers that hardly change make bones that
    keep their lengths.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # a damaged file may hold any number
        middles = [
            0.5 * (nodes[f"{joint}_left"] + nodes[f"{joint}_right"]) for joint in ("shoulder", "hip", "ankle")
        ]
        shoulders, hips, ankles = (middle[np.isfinite(middles).all(axis=(0, 2))] for middle in middles)
        return not len(hips) or is_a_person(
            shoulders, hips, ankles, arm=bones[0] + bones[1], leg=bones[2] + bones[3]
        )


def _pelvis_at_hips(nodes: Mapping[str, Array]) -> bool:
    """Whether the pelvis is nearer to the hips than to the shoulders, where it is a joint of its own; one at
    the origin is no measurement."""
    if "hip_center" not in nodes:
        return True
    pelvis = nodes["hip_center"]
    with np.errstate(over="ignore", invalid="ignore"):  # a damaged file may hold any number
        to_hips, to_shoulders = (
            np.linalg.norm(pelvis - 0.5 * (nodes[f"{end}_left"] + nodes[f"{end}_right"]), axis=-1)
            for end in ("hip", "shoulder")
        )
    seen = np.isfinite(to_hips) & np.isfinite(to_shoulders) & pelvis.any(axis=-1)
    return not seen.any() or bool(np.median(to_hips[seen]) < np.median(to_shoulders[seen]))
