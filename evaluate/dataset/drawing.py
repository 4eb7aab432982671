"""What the page draws of a motion: stick figures, and the curves of knees and hips, as few whole numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.angles import ANGLES
from kinemimic.pipeline.kinematics.skeleton import NODES, SIDES
from kinemimic.retarget.humanoid.motion import Motion, joint_angles

_POSES = 3
_POINTS = 33
_INDEX = {name: place for place, name in enumerate(NODES)}
_LIMBS = (
    ("hip_center", "spine", "shoulder_center", "head"),
    *(("shoulder_center", *(f"{joint}_{side}" for joint in ("shoulder", "elbow", "wrist", "hand")))
      for side in SIDES),
    *(("hip_center", *(f"{joint}_{side}" for joint in ("hip", "knee", "ankle", "foot")))
      for side in SIDES),
)  # fmt: skip


@dataclass(frozen=True)
class Drawing:
    """poses: of each, an SVG path from the side, in centimetres, the ground at y = 0 and up negative; curves:
    name of ANGLES -> degrees at equal steps from the first frame to the last."""

    poses: list[str]
    curves: dict[str, list[int]]


def drawing_of(motion: Motion) -> Drawing:
    """The drawing of a motion."""
    frames = len(motion.root)
    shown = np.unique(((np.arange(_POSES) + 0.5) / _POSES * frames).astype(int))
    positions, _ = Motion(
        rate=motion.rate,
        root=motion.root[shown],
        rotations=motion.rotations[shown],
        contacts=motion.contacts[shown],
        cyclic=False,
    ).kinematics()
    steps = np.linspace(0, frames - 1, _POINTS)
    curves = {
        name: [round(float(value)) for value in np.interp(steps, np.arange(frames), np.degrees(curve))]
        for name, curve in joint_angles(motion.rotations).items()
    }
    return Drawing([_path(pose) for pose in positions], {name: curves[name] for name in ANGLES})


def _path(pose: Array) -> str:
    """A figure (20, 3) as it is seen from its right side, so that it faces to the right."""
    across = pose[_INDEX["hip_left"], :2] - pose[_INDEX["hip_right"], :2]
    length = float(np.hypot(*across))
    forward = np.array([across[1], -across[0]]) / length if length > 0.0 else np.array([1.0, 0.0])
    along = (pose[:, :2] - pose[0, :2]) @ forward
    points = np.rint(100.0 * np.stack([along, -pose[:, 2]], axis=1)).astype(int)
    return "".join(
        "M" + "L".join(f"{points[_INDEX[node], 0]} {points[_INDEX[node], 1]}" for node in limb)
        for limb in _LIMBS
    )
