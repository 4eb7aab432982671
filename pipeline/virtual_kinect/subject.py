"""The person in front of the virtual Kinect: a gait that can be sampled at any time, and its true joints.

The stock walk and run are half a cycle and its mirror image, with two discontinuities of 7 to 10 degrees. A
Fourier fit in the phase closes both and makes velocities continuous.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.angles import leg_angles
from kinemimic.pipeline.kinematics.clip import Clip, forward_kinematics
from kinemimic.pipeline.kinematics.rotations import from_axis_angle, from_rotvec, multiply, rotate, to_rotvec
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODES, Skeleton
from kinemimic.pipeline.locomotion import fourier

HARMONICS = 8

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

    period: seconds; stride: metres per cycle; root: (1 + 2H, 3) Fourier series of the root's position minus
    its steady advance; rotations: (1 + 2H, 20, 3) series of the nodes' rotation vectors; skeleton: with bone
    lengths.
    """

    period: float
    stride: float
    root: Array
    rotations: Array
    skeleton: Skeleton

    @property
    def speed(self) -> float:
        """Metres per second."""
        return self.stride / self.period

    def pose(self, phase: Array) -> tuple[Array, Array]:
        """Root positions (T, 3) and local rotations (T, 20, 4) at phases (T,) in cycles, not wrapped."""
        root = fourier.evaluate(self.root, phase)
        root[:, 0] += phase * self.stride
        return root, from_rotvec(fourier.evaluate(self.rotations, phase))


@dataclass(frozen=True)
class GroundTruth:
    """The true motion at T times.

    joints: (T, 20, 3) metres in the world, as an ideal sensor would report them; heading: (T,) of the path,
    radians from +X; angles: name in kinematics.angles.ANGLES -> (T,) radians, from the true hip joints and
    pelvis.
    """

    joints: Array
    heading: Array
    angles: dict[str, Array]


def close_loop(clip: Clip, harmonics: int = HARMONICS) -> Gait:
    """The gait of a looped clip, whose last frame is its first one a cycle later, rotated to walk
    along +X."""
    if clip.rotations is None or clip.translations is None:
        raise ValueError("a gait needs a clip of rotations")
    advance = clip.translations[-1, 0] - clip.translations[0, 0]
    straight = from_axis_angle("Z", -np.arctan2(advance[1], advance[0]))
    phase = np.linspace(0.0, 1.0, len(clip.times))[:-1]
    root = rotate(straight, clip.translations[:-1, 0] - clip.translations[0, 0] * [1.0, 1.0, 0.0])
    stride = float(np.hypot(advance[0], advance[1]))
    root[:, 0] -= phase * stride
    rotations = clip.rotations[:-1].copy()
    rotations[:, 0] = multiply(straight, rotations[:, 0])
    return Gait(
        period=float(clip.times[-1] - clip.times[0]),
        stride=stride,
        root=fourier.fit(phase, root, harmonics),
        rotations=fourier.fit(phase, to_rotvec(rotations), harmonics),
        skeleton=clip.skeleton,
    )


def ground_truth(gait: Gait, elapsed: Array, *, start: Array, heading: float, phase: float) -> GroundTruth:
    """The motion in a straight line at times (T,) in seconds after passing `start` (2,) at `phase` in
    cycles."""
    cycles = phase + elapsed / gait.period
    root, rotations = gait.pose(cycles)
    root[:, 0] -= phase * gait.stride
    to_heading = from_axis_angle("Z", heading)
    root = rotate(to_heading, root) + np.append(start, 0.0)
    rotations[:, 0] = multiply(to_heading, rotations[:, 0])
    translations = np.broadcast_to(gait.skeleton.offsets, (len(cycles), len(NODES), 3)).copy()
    translations[:, 0] = root
    positions, world = forward_kinematics(gait.skeleton, translations, rotations)
    joints = positions.copy()
    for node, (carrier, offset) in _SENSOR_JOINTS.items():
        c = NODE_INDEX[carrier]
        joints[:, NODE_INDEX[node]] = positions[:, c] + rotate(world[:, c], np.array(offset))
    return GroundTruth(joints, np.full(len(cycles), heading), leg_angles(positions, pelvis=world[:, 0]))
