"""Ranges of motion of human joints, the angles that they limit, and by how much a motion exceeds them.

A ball joint's rotation is decomposed into a swing of its bone (a rotation vector about the parent's X and Y)
and a twist about the bone, R = swing · twist. Limits are boxes in these three angles.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import continuous, from_axis_angle, from_rotvec, multiply
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX

# Degrees from the neutral standing pose, (least, most) about X, Y and Z of the parent. American Academy of
# Orthopaedic Surgeons, Joint Motion: Method of Measuring and Recording (1965), as in Norkin & White,
# Measurement of Joint Motion (5th ed., 2016). Wider where the recorded movements exceed them:
# - neck: the American Medical Association's 60 forward and back and 80 to each side;
# - hip flexion 135 (AAOS 120) and knee flexion 150 (AAOS 135): a deep squat; knees and elbows may
#   hyperextend by 5, which is common;
# - dorsiflexion 45 (AAOS 20, unloaded): in a squat or lunge the shank turns over the loaded foot by as much
#   (Bennell et al. 1998, Australian Journal of Physiotherapy 44: 175-180);
# - the wrist's twist is the forearm's (80), which a hinged elbow does not have, with 10 of its own;
# - an arm raised forward goes 45 across the body, a swing of up to 85 inward; its twist is free: against the
#   shortest swing it is not the clinical rotation once the arm is up (Codman's paradox).
# Left limbs: X lifts outward, Y backward, Z turns the front outward; the right side is their mirror image.
# Trunk and neck: X bends to the right, Y forward, Z turns to the left.
_TRUNK_LIMITS = {
    "spine": ((-35, 35), (-30, 80), (-45, 45)),
    "shoulder_center": ((-45, 45), (-60, 60), (-80, 80)),
}
_LEFT_LIMITS = {
    "shoulder": ((-85, 180), (-180, 60), (-180, 180)),
    "elbow": ((0, 0), (-150, 5), (0, 0)),
    "wrist": ((-30, 30), (-80, 80), (-90, 90)),
    "hip": ((-30, 45), (-135, 30), (-45, 45)),
    "knee": ((0, 0), (-5, 150), (0, 0)),
    "ankle": ((-35, 20), (-45, 50), (-35, 35)),
}
HINGE_JOINTS: tuple[str, ...] = ("elbow_left", "elbow_right", "knee_left", "knee_right")
# Excess (radians) that is ignored: a curve may touch its limit.
TOLERANCE = np.radians(0.5)


def _table() -> dict[str, Array]:
    limits = {name: np.radians(np.array(box, dtype=np.float64)) for name, box in _TRUNK_LIMITS.items()}
    for joint, box in _LEFT_LIMITS.items():
        left = np.radians(np.array(box, dtype=np.float64))
        right = left.copy()
        right[[0, 2]] = -left[[0, 2], ::-1]
        limits |= {f"{joint}_left": left, f"{joint}_right": right}
    return limits


# Joint -> (3, 2) radians: minimum and maximum of the swing about X and Y and of the twist about Z.
LIMITS: dict[str, Array] = _table()


def swing_twist(q: Array) -> Array:
    """Swing about X and Y and twist about Z, (..., 3) radians, of rotations q (..., 4)."""
    return swing_twist_jacobian(q)[0]


def swing_twist_jacobian(q: Array) -> tuple[Array, Array]:
    """`swing_twist` (..., 3) and its derivative (..., 3, 3) by a small rotation d in q · exp(d).

    With q = (x, y, z, w), c² = z² + w² and m² = x² + y², the swing is 2 asin(m) / (m c) · (x w - y z,
    x z + y w) and the twist 2 atan2(z, w). At c = 0 the bone points opposite to its rest direction: the
    direction of swing is undefined there, and the derivative is large but finite.
    """
    x, y, z, w = np.moveaxis(np.where(q[..., 3:] < 0, -q, q), -1, 0)
    c = np.maximum(np.hypot(z, w), 1e-6)
    m = np.hypot(x, y)
    near = m < 1e-4
    safe = np.where(near, 1.0, m)
    angle = 2.0 * np.arctan2(m, c)
    # g = angle / (m c) = 2 + 4/3 m² + …; h is its derivative by m, over m.
    g = np.where(near, 2.0 + 4.0 / 3.0 * m**2, angle / (safe * c))
    slope = 2.0 / (safe * c**2) - angle * (c - m**2 / c) / (safe * c) ** 2
    h = np.where(near, 8.0 / 3.0, slope / safe)
    a, b = x * w - y * z, x * z + y * w
    angles = np.stack([g * a, g * b, 2.0 * np.arctan2(z, w)], axis=-1)
    zero = np.zeros_like(x)
    by_q = np.stack(
        [
            np.stack([h * a * x + g * w, h * a * y - g * z, -g * y, g * x], axis=-1),
            np.stack([h * b * x + g * z, h * b * y + g * w, g * x, g * y], axis=-1),
            np.stack([zero, zero, 2.0 * w / c**2, -2.0 * z / c**2], axis=-1),
        ],
        axis=-2,
    )
    # d(q · exp d)/dd at 0: half of the quaternion product with (d, 0).
    by_turn = 0.5 * np.stack(
        [
            np.stack([w, -z, y], axis=-1),
            np.stack([z, w, -x], axis=-1),
            np.stack([-y, x, w], axis=-1),
            np.stack([-x, -y, -z], axis=-1),
        ],
        axis=-2,
    )
    return angles, by_q @ by_turn


def clamp_to_limits(joint: str, q: Array) -> Array:
    """Local rotations q (T, 4) of a joint with swing and twist clamped to their limits."""
    least, most = LIMITS[joint][:, 0], LIMITS[joint][:, 1]
    angles = swing_twist(q)
    inside = np.clip(angles, least, most)
    if np.allclose(inside, angles, atol=1e-9):
        return q
    swing = from_rotvec(np.concatenate([inside[:, :2], np.zeros((len(q), 1))], axis=-1))
    return continuous(
        np.where(
            np.isclose(inside, angles, atol=1e-9).all(axis=-1, keepdims=True),
            q,
            multiply(swing, from_axis_angle("Z", inside[:, 2])),
        )
    )


def limit_excess(rotations: Array) -> dict[str, Array]:
    """Radians (T,) by which each joint of LIMITS exceeds them, 0 within; rotations: local (T, 20, 4)."""
    beyond: dict[str, Array] = {}
    for joint, limits in LIMITS.items():
        angles = swing_twist(rotations[:, NODE_INDEX[joint]])
        beyond[joint] = np.maximum(angles - limits[:, 1], limits[:, 0] - angles).max(axis=-1).clip(min=0.0)
    return beyond


def beyond_limits(rotations: Array) -> dict[str, float]:
    """The joints of local rotations (T, 20, 4) that exceed their limits in any frame -> radians."""
    worst = {joint: float(values.max(initial=0.0)) for joint, values in limit_excess(rotations).items()}
    return {joint: value for joint, value in worst.items() if value > TOLERANCE}
