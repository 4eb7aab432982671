"""How the virtual Kinect stands: levelled, with a floor that it misjudges or does not find, or turning.

A Kinect v1's recorder writes joints above the floor that the sensor found. Where that floor is wrong, the
recorded person leans and walks up or down a slope; where there is none, joints are relative to the sensor.
Joint angles do not change.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.ndimage import gaussian_filter1d

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import conjugate, from_axis_angle, multiply, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.virtual_kinect.camera import Camera
from kinemimic.pipeline.virtual_kinect.noise import NoiseLevels, Observation, observe
from kinemimic.pipeline.virtual_kinect.subject import GroundTruth

# Seconds over which the turning sensor follows the person, as an arm that pulls a dish does.
_FOLLOWING = 0.3


@dataclass(frozen=True)
class Placement:
    """camera: as it stands; pitch, roll (radians), height (metres): errors of the floor that the sensor
    found; floor: whether it found one; turns: whether the sensor turns with the person, who walks round
    it."""

    camera: Camera = field(default_factory=Camera)
    pitch: float = 0.0
    roll: float = 0.0
    height: float = 0.0
    floor: bool = True
    turns: bool = False

    @property
    def floor_plane(self) -> Array:
        """A, B, C, D (4,) of the floor as recorded, in the sensor's X left, Y up, Z forward; zeros without
        one."""
        if not self.floor:
            return np.zeros(4)
        axes = rotate(from_axis_angle("Y", self.camera.tilt), np.eye(3)[[1, 2, 0]])
        up = rotate(conjugate(self._error), np.array([0.0, 0.0, 1.0]))
        return np.append(axes @ up, self.camera.height + self.height)

    @property
    def _error(self) -> Array:
        """Rotation (4,) from the room to the recorded coordinates."""
        if not self.floor:
            return from_axis_angle("Y", -self.camera.tilt)
        return multiply(from_axis_angle("Y", self.pitch), from_axis_angle("X", self.roll))

    def recorded(self, points: Array) -> Array:
        """Points (..., 3) of the room, where the sensor is at (0, 0, height), in the file's coordinates."""
        origin = np.array([0.0, 0.0, self.camera.height + self.height if self.floor else 0.0])
        return np.asarray(rotate(self._error, points - self.camera.position) + origin)


# Floors found by real sensors are some degrees and centimetres off.
PLACEMENTS: dict[str, Placement] = {
    "fixed": Placement(),
    "tilted": Placement(pitch=np.radians(4.0), roll=np.radians(-2.5), height=-0.12),
    "no-floor": Placement(camera=replace(Camera(), tilt=np.radians(8.0)), floor=False),
    "turning": Placement(turns=True),
}


def see(
    truth: GroundTruth, times: Array, placement: Placement, levels: NoiseLevels, rng: np.random.Generator
) -> Observation:
    """One pass as recorded: the truth in the room, at times (T,) in seconds."""
    joints, heading = truth.joints, truth.heading
    if placement.turns:
        yaw = _follow(joints[:, NODE_INDEX["hip_center"]], times)
        joints, heading = rotate(from_axis_angle("Z", -yaw)[:, None], joints), heading - yaw
    seen = observe(joints, heading, times, placement.camera, levels, rng)
    return replace(seen, positions=placement.recorded(seen.positions))


def _follow(person: Array, times: Array) -> Array:
    """Yaw (T,) in radians of a sensor that follows a person (T, 3) smoothly."""
    azimuth = np.unwrap(np.arctan2(person[:, 1], person[:, 0]))
    frames = _FOLLOWING / max(float(np.median(np.diff(times))), 1e-3)
    return np.asarray(gaussian_filter1d(azimuth, frames, mode="nearest"))
