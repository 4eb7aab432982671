"""The virtual Kinect's camera: where a joint falls in its depth image, and what hides it there."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N

# Depth image of the Kinect v1 SDK: NUI_CAMERA_DEPTH_NOMINAL_FOCAL_LENGTH_IN_PIXELS at 320 x 240.
FOCAL = 285.63
WIDTH, HEIGHT = 320, 240
# A limb hides what lies at least so far behind its axis (metres); what is nearer is its own skin.
BEHIND = 0.06

# Limbs that hide: ends, radius in metres, and further joints that they do not hide because they carry them.
_SIDES = ("left", "right")
_LIMBS: tuple[tuple[str, str, float, tuple[str, ...]], ...] = (
    ("hip_center", "shoulder_center", 0.13, ("spine", "hip_left", "hip_right", "head")),
    *(("hip_" + side, "knee_" + side, 0.075, ("hip_center",)) for side in _SIDES),
    *(("knee_" + side, "ankle_" + side, 0.055, ("foot_" + side,)) for side in _SIDES),
    *(("shoulder_" + side, "elbow_" + side, 0.05, ("shoulder_center",)) for side in _SIDES),
    *(("elbow_" + side, "wrist_" + side, 0.04, ("hand_" + side,)) for side in _SIDES),
)
# The sensor's own fit of the trunk never calls these inferred (0 to 0.2 % in real recordings).
TRUNK: list[int] = [N[name] for name in ("hip_center", "spine", "shoulder_center", "hip_left", "hip_right")]


@dataclass(frozen=True)
class Camera:
    """Above the world's origin, looking along +X and a little down.

    height: of the sensor over the floor, metres; tilt: downward, radians.
    """

    height: float = 0.9
    tilt: float = np.radians(3.0)

    @property
    def position(self) -> Array:
        """(3,) in the world."""
        return np.array([0.0, 0.0, self.height])

    @property
    def floor_plane(self) -> Array:
        """(4,) A, B, C, D of the floor A x + B y + C z + D = 0 in the sensor's X left, Y up, Z forward."""
        return np.array([0.0, np.cos(self.tilt), -np.sin(self.tilt), self.height])

    def project(self, points: Array) -> tuple[Array, Array]:
        """Pixels (..., 2) and depths (...,) in metres of points (..., 3) in the world."""
        c, s = np.cos(self.tilt), np.sin(self.tilt)
        # OpenCV's camera: x right, y down, z forward.
        turn = np.array([[0.0, -1.0, 0.0], [-s, 0.0, -c], [c, 0.0, -s]])
        matrix = np.array([[FOCAL, 0.0, WIDTH / 2], [0.0, FOCAL, HEIGHT / 2], [0.0, 0.0, 1.0]])
        flat = np.ascontiguousarray(points.reshape(-1, 3))
        pixels, _ = cv2.projectPoints(
            flat, cv2.Rodrigues(turn)[0], -turn @ self.position, matrix, np.zeros(5)
        )
        depth = (flat - self.position) @ turn[2]
        return np.asarray(pixels, np.float64).reshape(*points.shape[:-1], 2), depth.reshape(points.shape[:-1])


def hidden(camera: Camera, joints: Array) -> Mask:
    """Joints (T, 20) of figures (T, 20, 3) that a nearer limb covers or that lie outside the image.

    A limb is a capsule: it covers a joint whose pixel lies within the projected radius of its axis, where
    the axis is nearer than the joint.
    """
    pixels, depth = camera.project(joints)
    outside = np.any((pixels < 0) | (pixels >= [WIDTH, HEIGHT]), axis=-1)
    covered = np.zeros(depth.shape, dtype=np.bool_)
    for start, end, radius, carried in _LIMBS:
        along, axis_depth = _nearest(pixels, depth, N[start], N[end])
        by_limb = (along < FOCAL * radius / axis_depth) & (axis_depth + BEHIND < depth)
        by_limb[:, [N[name] for name in (start, end, *carried)]] = False
        covered |= by_limb
    unseen: Mask = outside | covered
    unseen[:, TRUNK] = False
    return unseen


def _nearest(pixels: Array, depth: Array, start: int, end: int) -> tuple[Array, Array]:
    """Distance in pixels (T, 20) of every joint to a limb's axis, and the axis' depth (T, 20) there."""
    a, b = pixels[:, start, None], pixels[:, end, None]
    bone = b - a
    length = np.maximum(np.sum(bone * bone, axis=-1), 1e-9)
    share = np.clip(np.sum((pixels - a) * bone, axis=-1) / length, 0.0, 1.0)
    gap = np.linalg.norm(pixels - a - share[..., None] * bone, axis=-1)
    # Along an image line it is the inverse of the depth that changes evenly.
    inverse = (1.0 - share) / depth[:, start, None] + share / depth[:, end, None]
    return gap, 1.0 / inverse
