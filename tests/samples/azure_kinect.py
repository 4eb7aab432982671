"""Azure Kinect body tracking in the layout of the SDK's offline_processor: sorted keys, indented by four."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import from_two_axes
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODES
from kinemimic.pipeline.readers.kinect.azure_joints import AZURE_JOINTS, azure_skeleton
from samples.motion import Walk, in_sight, walk

# Where the camera stands in our axes, metres: 2 m behind the start, at the height of the chest.
CAMERA = np.array([-2.0, 0.3, 1.1])
PERSON, BYSTANDER = 3, 7


def joints(shown: Walk) -> Array:
    """(T, 32, 3) in our axes from the 20 nodes: clavicles, chest, face, tips and thumbs are added."""
    p = {name.upper(): shown.joints[:, NODE_INDEX[name]] for name in NODES}
    p |= {"PELVIS": p["HIP_CENTER"], "SPINE_NAVEL": p["SPINE"], "NECK": p["SHOULDER_CENTER"]}
    p["SPINE_CHEST"] = 0.5 * (p["SPINE_NAVEL"] + p["NECK"])
    p["NOSE"] = p["HEAD"] + np.array([0.1, 0.0, 0.02])
    for side, sign in (("LEFT", 1.0), ("RIGHT", -1.0)):
        p[f"CLAVICLE_{side}"] = 0.8 * p["NECK"] + 0.2 * p[f"SHOULDER_{side}"]
        p[f"HANDTIP_{side}"] = p[f"HAND_{side}"] + 0.9 * (p[f"HAND_{side}"] - p[f"WRIST_{side}"])
        p[f"THUMB_{side}"] = p[f"HAND_{side}"] + np.array([0.05, 0.0, 0.0])
        p[f"EYE_{side}"] = p["HEAD"] + np.array([0.08, 0.03 * sign, 0.05])
        p[f"EAR_{side}"] = p["HEAD"] + np.array([0.0, 0.08 * sign, 0.02])
    return np.stack([p[name] for name in AZURE_JOINTS], axis=1)


def camera_axes(vectors: Array) -> Array:
    """Our axes (X away from the camera, Y to its left, Z up) to the camera's: X right, Y down, Z forward."""
    return np.stack([-vectors[..., 1], -vectors[..., 2], vectors[..., 0]], axis=-1)


def orientations(places: Array) -> Array:
    """(T, 32, 4) x, y, z, w in the axes of `places`: X of every frame along the bone that ends there."""
    parents = azure_skeleton().parents
    bones = places - places[:, [max(parent, 0) for parent in parents]]
    bones[:, 0] = places[:, 1] - places[:, 0]
    return from_two_axes(bones, np.broadcast_to([0.11, 0.13, 0.97], bones.shape), "XZ")


def body(number: int, places: Array, turns: Array) -> dict[str, Any]:
    """One body of one frame; places in mm (32, 3), turns (32, 4) w first, in the SDK's single precision."""
    return {
        "body_id": number,
        "joint_orientations": np.float32(turns).astype(float).tolist(),
        "joint_positions": np.float32(places).astype(float).tolist(),
    }


def document(frames: int = 90) -> dict[str, Any]:
    """The person in all frames but three; a bystander a metre beside in a third of them."""
    shown = in_sight(walk(frames))
    places = camera_axes(joints(shown) - CAMERA)
    turns = orientations(places)[..., [3, 0, 1, 2]]
    beside = places + np.array([1.0, 0.0, 0.5])
    results = []
    for number, time in enumerate(shown.times):
        bodies = []
        if frames // 3 <= number < 2 * frames // 3:
            bodies.append(body(BYSTANDER, 1000.0 * beside[number], turns[number]))
        if not 5 <= number < 8:
            bodies.append(body(PERSON, 1000.0 * places[number], turns[number]))
        results.append(
            {
                "bodies": bodies,
                "frame_id": number,
                "num_bodies": len(bodies),
                "timestamp_usec": 266_744 + round(1e6 * time),
            }
        )
    bones = [
        [AZURE_JOINTS[parent], name]
        for name, parent in zip(AZURE_JOINTS, azure_skeleton().parents, strict=True)
    ]
    return {
        "bone_list": bones[1:],
        "frames": results,
        "joint_names": list(AZURE_JOINTS),
        "k4abt_sdk_version": "1.1.2",
        "source_file": "walk.mkv",
    }


def files(frames: int = 90) -> dict[str, bytes]:
    """The document as text."""
    return {"walk.json": json.dumps(document(frames), indent=4, sort_keys=True).encode()}
