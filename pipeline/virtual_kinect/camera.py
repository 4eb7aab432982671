"""The virtual Kinect's camera: projects joints into its depth image and finds the occluded ones."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import SIDES

# Focal length in pixels of the Kinect v1 SDK's depth image: NUI_CAMERA_DEPTH_NOMINAL_FOCAL_LENGTH_IN_PIXELS
# at 320 x 240.
FOCAL = 285.63
WIDTH, HEIGHT = 320, 240
# A limb occludes joints at least this far behind its axis (metres); nearer ones are on its own surface.
OCCLUSION_DEPTH = 0.06

# Occluding limbs: ends, radius in metres, and further joints that they do not occlude because they carry
# them.
_LIMBS: tuple[tuple[str, str, float, tuple[str, ...]], ...] = (
    ("hip_center", "shoulder_center", 0.13, ("spine", "hip_left", "hip_right", "head")),
    *(("hip_" + side, "knee_" + side, 0.075, ("hip_center",)) for side in SIDES),
    *(("knee_" + side, "ankle_" + side, 0.055, ("foot_" + side,)) for side in SIDES),
    *(("shoulder_" + side, "elbow_" + side, 0.05, ("shoulder_center",)) for side in SIDES),
    *(("elbow_" + side, "wrist_" + side, 0.04, ("hand_" + side,)) for side in SIDES),
)
# The sensor's model fit never reports these trunk joints as inferred (0 to 0.2 % in real recordings).
TRUNK: list[int] = [N[name] for name in ("hip_center", "spine", "shoulder_center", "hip_left", "hip_right")]


@dataclass(frozen=True)
class Camera:
    """The pose of the sensor: above the world's origin, looking along +X and slightly down.

    height: above the floor, metres; tilt: downward, radians.
    """

    height: float = 0.9
    tilt: float = np.radians(3.0)

    @property
    def position(self) -> Array:
        """Position (3,) in the world."""
        return np.array([0.0, 0.0, self.height])

    @property
    def floor_plane(self) -> Array:
        """A, B, C, D (4,) of the floor A x + B y + C z + D = 0 in the sensor's X left, Y up, Z forward."""
        return np.array([0.0, np.cos(self.tilt), -np.sin(self.tilt), self.height])

    def project(self, points: Array) -> tuple[Array, Array]:
        """Pixels (..., 2) and depths (...,) in metres of world points (..., 3)."""
        c, s = np.cos(self.tilt), np.sin(self.tilt)
        # OpenCV's camera axes: x right, y down, z forward.
        world_to_camera = np.array([[0.0, -1.0, 0.0], [-s, 0.0, -c], [c, 0.0, -s]])
        matrix = np.array([[FOCAL, 0.0, WIDTH / 2], [0.0, FOCAL, HEIGHT / 2], [0.0, 0.0, 1.0]])
        flat = np.ascontiguousarray(points.reshape(-1, 3))
        pixels, _ = cv2.projectPoints(
            flat, cv2.Rodrigues(world_to_camera)[0], -world_to_camera @ self.position, matrix, np.zeros(5)
        )
        depth = (flat - self.position) @ world_to_camera[2]
        return np.asarray(pixels, np.float64).reshape(*points.shape[:-1], 2), depth.reshape(points.shape[:-1])


def occluded(camera: Camera, joints: Array) -> Mask:
    """Joints (T, 20) of bodies (T, 20, 3) that a nearer limb occludes or that are outside the image.

    A limb is a capsule: it occludes a joint whose pixel is within the projected radius of its axis, if the
    axis is nearer than the joint.
    """
    pixels, depth = camera.project(joints)
    outside = np.any((pixels < 0) | (pixels >= [WIDTH, HEIGHT]), axis=-1)
    hidden = np.zeros(depth.shape, dtype=np.bool_)
    for start, end, radius, attached in _LIMBS:
        distance, axis_depth = _nearest(pixels, depth, N[start], N[end])
        hidden_by_limb = (distance < FOCAL * radius / axis_depth) & (axis_depth + OCCLUSION_DEPTH < depth)
        hidden_by_limb[:, [N[name] for name in (start, end, *attached)]] = False
        hidden |= hidden_by_limb
    not_visible: Mask = outside | hidden
    not_visible[:, TRUNK] = False
    return not_visible


def _nearest(pixels: Array, depth: Array, start: int, end: int) -> tuple[Array, Array]:
    """Distance in pixels (T, 20) from every joint to a limb's axis, and the axis' depth (T, 20) there."""
    a, b = pixels[:, start, None], pixels[:, end, None]
    bone = b - a
    length = np.maximum(np.sum(bone * bone, axis=-1), 1e-9)
    share = np.clip(np.sum((pixels - a) * bone, axis=-1) / length, 0.0, 1.0)
    distance = np.linalg.norm(pixels - a - share[..., None] * bone, axis=-1)
    # The inverse of the depth is linear along a line in the image.
    inverse = (1.0 - share) / depth[:, start, None] + share / depth[:, end, None]
    return distance, 1.0 / inverse
