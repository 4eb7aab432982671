"""The person in front of the virtual Kinect: a gait that can be sampled at any phase, and its true joints.

The stock walk and run are half a cycle and its mirror image, with two discontinuities of 7 to 29 degrees.
They are closed near the seams only, and the samples are joined by a periodic cubic spline: not by a Fourier
series, which is the model of `retarget`: its accuracy would then be tested on its own model.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.angles import leg_angles
from kinemimic.pipeline.kinematics.clip import Clip, forward_kinematics
from kinemimic.pipeline.kinematics.rotations import from_axis_angle, from_rotvec, multiply, rotate, to_rotvec
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODES, Skeleton

# Share of the cycle on either side of a seam over which its discontinuity is spread.
SEAM = 0.12

# Positions of the sensor's 20 joints on the humanoid: carrying node and offset in its frame, metres. The
# Kinect's hip centre is some centimetres above the hip joints and its spine joint just above the hip centre,
# both on the pelvis; its foot joint is at the toes.
_SENSOR_JOINTS: dict[str, tuple[str, tuple[float, float, float]]] = {
    "hip_center": ("hip_center", (0.0, 0.0, 0.07)),
    "spine": ("hip_center", (0.0, 0.0, 0.15)),
    "shoulder_center": ("spine", (0.0, 0.0, 0.235)),
    "head": ("shoulder_center", (0.0, 0.0, 0.20)),
    "shoulder_left": ("spine", (-0.02, 0.16, 0.22)),
    "shoulder_right": ("spine", (-0.02, -0.16, 0.22)),
    "foot_left": ("ankle_left", (0.10, 0.0, -0.03)),
    "foot_right": ("ankle_right", (0.10, 0.0, -0.03)),
}


@dataclass(frozen=True)
class Gait:
    """A closed gait cycle along +X.

    period: seconds; stride: metres per cycle; root: spline of the root's position (3,) in the phase, minus
    its steady advance; rotations: spline of the nodes' rotation vectors (20, 3); skeleton: with bone lengths.
    """

    period: float
    stride: float
    root: CubicSpline
    rotations: CubicSpline
    skeleton: Skeleton

    @property
    def speed(self) -> float:
        """Metres per second."""
        return self.stride / self.period

    def pose(self, phase: Array) -> tuple[Array, Array]:
        """Root positions (T, 3) and local rotations (T, 20, 4) at phases (T,) in cycles, not wrapped."""
        root = np.array(self.root(phase))
        root[:, 0] += phase * self.stride
        return root, from_rotvec(self.rotations(phase))


@dataclass(frozen=True)
class GroundTruth:
    """The true motion at T times.

    joints: (T, 20, 3) metres in the world, as an ideal sensor would report them; heading: (T,) of the body,
    radians from +X; phase: (T,) cycles; angles: name in kinematics.angles.ANGLES -> (T,) radians, from the
    true hip joints and pelvis.
    """

    joints: Array
    heading: Array
    phase: Array
    angles: dict[str, Array]

    def at(self, rows: NDArray[np.intp]) -> GroundTruth:
        """The same at some of the times."""
        angles = {name: curve[rows] for name, curve in self.angles.items()}
        return GroundTruth(self.joints[rows], self.heading[rows], self.phase[rows], angles)

    @property
    def columns(self) -> dict[str, Array]:
        """Columns (T,) of the truth file: the angles, the strides and the path of the hips in the room."""
        x, y = self.joints[:, NODE_INDEX["hip_center"], :2].T
        return {**self.angles, "stride": self.phase, "x": x, "y": y, "heading": self.heading}


def close_loop(clip: Clip) -> Gait:
    """The gait of a looped clip, whose last frame is its first one a cycle later, rotated to walk
    along +X."""
    if clip.rotations is None or clip.translations is None:
        raise ValueError("a gait needs a clip of rotations")
    advance = clip.translations[-1, 0] - clip.translations[0, 0]
    straight = from_axis_angle("Z", -np.arctan2(advance[1], advance[0]))
    phase = np.linspace(0.0, 1.0, len(clip.times))
    root = rotate(straight, clip.translations[:-1, 0] - clip.translations[0, 0] * [1.0, 1.0, 0.0])
    stride = float(np.hypot(advance[0], advance[1]))
    root[:, 0] -= phase[:-1] * stride
    rotations = clip.rotations[:-1].copy()
    rotations[:, 0] = multiply(straight, rotations[:, 0])
    return Gait(
        period=float(clip.times[-1] - clip.times[0]),
        stride=stride,
        root=periodic_spline(phase, _without_seams(root)),
        rotations=periodic_spline(phase, _without_seams(to_rotvec(rotations))),
        skeleton=clip.skeleton,
    )


def periodic_spline(phase: Array, values: Array) -> CubicSpline:
    """The spline through values (T, ...) at phases (T + 1,), the last of which is the first a cycle later."""
    return CubicSpline(phase, np.concatenate([values, values[:1]]), bc_type="periodic")


def _without_seams(values: Array) -> Array:
    """Values (T, ...) of a cycle whose second half begins with a jump, and whose end does not meet its start.

    A jump is what a step exceeds the mean of the two steps beside it by; half of it is taken from either
    side, fading out over SEAM.
    """
    count = len(values)
    closed = values.copy()
    for first in (count // 2, 0):  # the first sample after a seam
        before, after = (
            np.take(values, [first + a, first + b], axis=0, mode="wrap") for a, b in ((-2, -1), (0, 1))
        )
        jump = (after[0] - before[1]) - 0.5 * ((before[1] - before[0]) + (after[1] - after[0]))
        distance = (np.arange(count) - first + 0.5) / count  # of each sample from the seam, in cycles
        distance -= np.round(distance)
        fade = np.where(np.abs(distance) < SEAM, np.cos(0.5 * np.pi * distance / SEAM) ** 2, 0.0)
        weight = -0.5 * np.sign(distance) * fade
        closed += weight.reshape(-1, *([1] * (values.ndim - 1))) * jump
    return closed


def observed_body(
    skeleton: Skeleton, root: Array, rotations: Array, heading: Array, phase: Array
) -> GroundTruth:
    """The true joints and angles of a body.

    root: (T, 3) metres in the world; rotations: (T, 20, 4) local, the root's before the body turns to
    `heading` (T,) in radians.
    """
    turned = rotations.copy()
    turned[:, 0] = multiply(from_axis_angle("Z", heading), rotations[:, 0])
    translations = np.broadcast_to(skeleton.offsets, (len(root), len(NODES), 3)).copy()
    translations[:, 0] = root
    positions, world = forward_kinematics(skeleton, translations, turned)
    joints = positions.copy()
    for node, (carrier, offset) in _SENSOR_JOINTS.items():
        c = NODE_INDEX[carrier]
        joints[:, NODE_INDEX[node]] = positions[:, c] + rotate(world[:, c], np.array(offset))
    return GroundTruth(joints, heading, phase, leg_angles(positions, pelvis=world[:, 0]))
