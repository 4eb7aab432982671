"""The Euler-angle form of a recording: BVH in the order of Eq. 8, with one joint passing through gimbal lock.

In the file's rest pose the left arm is in a T-pose, the right arm hangs. The middle angle of YZX is the
elevation of the joint's own X axis, which lies along the left arm: when that arm hangs, the angle is -90
degrees. The T-pose is tilted slightly, so that one recorded frame is almost exactly at lock.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import conjugate, from_axis_angle, from_rotvec, multiply, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, TRACKED, Skeleton
from kinemimic.pipeline.readers.kinect.nui_skl import KINECT_V1_JOINTS
from kinemimic.pipeline.virtual_kinect.sdk_orientation import calibrate, hold_last, joint_rotations
from kinemimic.pipeline.writers.bvh import file_angles, write_bvh
from kinemimic.pipeline.writers.poses import Poses

ORDER = "YZX"
LOCKED_JOINT = "shoulder_left"
# Distance of the locked frame from exact lock; middle angle from which a frame counts as near lock (radians).
_DISTANCE_FROM_LOCK = np.radians(0.01)
NEAR_LOCK = np.radians(85.0)
_DOWN = np.array([0.0, 0.0, -1.0])


def write_euler_bvh(
    path: Path, positions: Array, states: NDArray[np.uint8], rows: NDArray[np.int64], *, frame_time: float
) -> dict[str, Any]:
    """Write joints (N, 20, 3) with states (N, 20) as BVH, frame k showing row rows[k].

    Returns what comes near lock.

    The result names the joint, the frames of the file (from 0) whose middle angle is 85 degrees or more as
    written, and the frame nearest to lock with its distance in degrees.
    """
    rotations = joint_rotations(positions)
    skeleton = calibrate(positions, states == TRACKED, rotations)
    arm = states[:, [NODE_INDEX[f"{joint}_left"] for joint in ("shoulder", "elbow", "wrist")]]
    skeleton, rotations = place_lock(skeleton, rotations, np.all(arm == TRACKED, axis=1))
    renamed = Skeleton(KINECT_V1_JOINTS, skeleton.parents, skeleton.offsets)
    root = hold_last(positions)[rows, NODE_INDEX["hip_center"]]
    write_bvh(path, Poses.rigid(renamed, 1.0 / frame_time, root, rotations[rows]), order=ORDER)
    # As in the file: six decimals of a degree.
    middle = np.abs(
        np.round(np.degrees(file_angles(rotations[rows], ORDER)[:, NODE_INDEX[LOCKED_JOINT], 1]), 6)
    )
    nearest = int(np.argmax(middle))
    return {
        "joint": KINECT_V1_JOINTS[NODE_INDEX[LOCKED_JOINT]],
        "order": ORDER,
        "near_deg": round(float(np.degrees(NEAR_LOCK)), 6),
        "nearest": {"frame": nearest, "deg_from_lock": round(90.0 - float(middle[nearest]), 6)},
        "frames": [int(frame) for frame in np.flatnonzero(middle >= np.degrees(NEAR_LOCK))],
    }


def place_lock(skeleton: Skeleton, rotations: Array, trusted: NDArray[np.bool_]) -> tuple[Skeleton, Array]:
    """The same motion on a skeleton whose left arm rests in a T-pose, tilted so that one frame is at lock.

    rotations: (N, 20, 4), identity = hanging; trusted: (N,) candidate frames; the one nearest to the arm's
    mean direction is placed at lock.
    """
    shoulder = NODE_INDEX[LOCKED_JOINT]
    # The world's down in the arm's frame: if the file's X axis points there, that frame is at lock.
    down = rotate(conjugate(rotations[:, shoulder]), _DOWN)
    mean_down = down[trusted].mean(axis=0)
    frame = int(np.argmin(np.where(trusted, np.linalg.norm(down - mean_down, axis=1), np.inf)))
    axis = np.cross(_DOWN, down[frame])
    sine = float(np.linalg.norm(axis))
    tilt = from_rotvec((np.arctan2(sine, down[frame] @ _DOWN) - _DISTANCE_FROM_LOCK) * axis / sine)
    rest = multiply(tilt, from_axis_angle("X", np.array(-0.5 * np.pi)))  # from the T-pose to hanging
    local, offsets = rotations.copy(), skeleton.offsets.copy()
    local[:, shoulder] = multiply(rotations[:, shoulder], rest)
    for joint in ("elbow_left", "wrist_left", "hand_left"):
        node = NODE_INDEX[joint]
        offsets[node] = rotate(conjugate(rest), offsets[node])
        local[:, node] = multiply(multiply(conjugate(rest), rotations[:, node]), rest)
    return Skeleton(skeleton.names, skeleton.parents, offsets), local
