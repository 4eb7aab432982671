"""Write OpenSim motions (.mot): poses of the 20 nodes as coordinates of the model gait2354.

Coordinates and their order are those of Delp et al. 1990 (gait2354) and, for the arms, Hamner, Seth & Delp
2010; readers/opensim/mot.py describes their axes.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.files.store import write_text
from kinemimic.pipeline.kinematics.angles import anatomical_knee, steady_leg
from kinemimic.pipeline.kinematics.euler_curves import euler_curves
from kinemimic.pipeline.kinematics.rotations import conjugate, multiply, rotate, to_rotvec
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODES
from kinemimic.pipeline.readers.opensim.mot import OPENSIM_JOINTS, WORLD_FROM_FILE
from kinemimic.pipeline.writers.poses import Poses

# Midpoint of the hips relative to the pelvis' origin in the models, metres.
_HIPS_MIDDLE = np.array(next(joint.offset for joint in OPENSIM_JOINTS if joint.name == "hip_center"))
_HEADER = """\
inDegrees=yes

Units are S.I. units (second, meters, Newtons, ...)
Angles are in degrees. X is forward, Y up, Z to the right.
knee_angle is negative in flexion, as in gait2354; elbow_flex is positive; ankle_angle is dorsiflexion.
Turns of the foot to the side, of neck and wrists are not in this file.
pelvis_tx, ty, tz put the model's hip joints where the motion's are; the model keeps its own lengths.
endheader"""


def write_mot(path: Path, poses: Poses, *, measured: bool = True) -> None:
    """Write poses of the 20 nodes, angles in degrees and positions in metres.

    Hinges (knees, ankles, elbows) get the part of their rotation about the lateral axis. That is all of it in
    knees and elbows, unless a simulated joint was forced apart; a foot's sideways rotation is lost. The
    models have no coordinates for neck and wrists. measured: whether a sensor saw the poses, which may have
    their knees' signs wrong (`angles.anatomical_knee`); those of a body that is simulated or fitted are its
    own.
    """
    if poses.skeleton.names != NODES:
        raise ValueError("an OpenSim motion needs poses of the 20 nodes")
    table = coordinates(poses, measured=measured)
    rows = np.stack([np.arange(len(poses.rotations)) / poses.rate, *table.values()], axis=1)
    row_format = "\t".join(["%.6f", *["%.8f"] * len(table)])
    lines = [
        path.stem,
        "version=1",
        f"nRows={len(rows)}",
        f"nColumns={rows.shape[1]}",
        _HEADER,
        "\t".join(["time", *table]),
        *(row_format % tuple(row) for row in rows.tolist()),
    ]
    write_text(path, "\n".join(lines) + "\n")


def coordinates(poses: Poses, *, measured: bool = True) -> dict[str, Array]:
    """Coordinates (T,) by name, in degrees and metres; measured: as in `write_mot`."""
    file_from_world = conjugate(WORLD_FROM_FILE)
    rotations = multiply(multiply(file_from_world, poses.rotations), WORLD_FROM_FILE)
    positions, _ = poses.kinematics()
    hips = 0.5 * (positions[:, NODE_INDEX["hip_left"]] + positions[:, NODE_INDEX["hip_right"]])
    across = positions[:, NODE_INDEX["hip_left"]] - positions[:, NODE_INDEX["hip_right"]]
    pelvis = rotate(file_from_world, hips) - rotate(rotations[:, 0], _HIPS_MIDDLE)

    def ball(node: str, *names: str, mirror: float = 1.0) -> dict[str, Array]:
        # Without jumps, for users that differentiate them.
        flexion, second, third = np.degrees(euler_curves(rotations[:, NODE_INDEX[node]], "ZXY")).T
        return dict(zip(names, (flexion, mirror * second, mirror * third), strict=True))

    def hinge(node: str) -> Array:
        return np.asarray(to_rotvec(rotations[:, NODE_INDEX[node]])[:, 2])

    table = ball("hip_center", "pelvis_tilt", "pelvis_list", "pelvis_rotation")
    table |= {f"pelvis_t{axis}": place for axis, place in zip("xyz", pelvis.T, strict=True)}
    for side, s, mirror in (("right", "r", 1.0), ("left", "l", -1.0)):
        hip = (f"hip_flexion_{s}", f"hip_adduction_{s}", f"hip_rotation_{s}")
        table |= ball(f"hip_{side}", *hip, mirror=mirror)
        knee = -hinge(f"knee_{side}")
        if measured:
            leg = [positions[:, NODE_INDEX[f"{joint}_{side}"]] for joint in ("hip", "knee", "ankle")]
            steady = steady_leg(across, leg[1] - leg[0], leg[2] - leg[1])
            knee = anatomical_knee(knee, np.arange(len(knee)) / poses.rate, steady=steady)
        table[f"knee_angle_{s}"] = -np.degrees(knee)
        table[f"ankle_angle_{s}"] = np.degrees(hinge(f"ankle_{side}"))
    table |= ball("spine", "lumbar_extension", "lumbar_bending", "lumbar_rotation")
    for side, s, mirror in (("right", "r", 1.0), ("left", "l", -1.0)):
        table |= ball(f"shoulder_{side}", f"arm_flex_{s}", f"arm_add_{s}", f"arm_rot_{s}", mirror=mirror)
        table[f"elbow_flex_{s}"] = np.degrees(hinge(f"elbow_{side}"))
    return table
