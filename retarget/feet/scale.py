"""Scaling from the person's proportions to the Table 1 body: leg length and stance width."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import forward_kinematics
from kinemimic.pipeline.kinematics.proportions import stature
from kinemimic.pipeline.kinematics.rotations import conjugate, from_axis_angle, multiply
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import node_skeleton
from kinemimic.pipeline.locomotion.leg_pose import leg_bones
from kinemimic.retarget.humanoid.body import LEG_LENGTH, TOTAL_MASS, node_offsets

# m between the ankles on the Table 1 body: its soles are 7 cm wide and must pass each other; of feet that are
# farther apart than walkers' usually are, a depth sensor is rather wrong.
LEAST_WIDTH, MOST_SENSED_WIDTH = 0.08, 0.16
_SIDES = (("left", 1.0), ("right", -1.0))


def length_scale(positions: Array) -> float:
    """Leg length of the Table 1 body over the person's: median bones of (M, 20, 3), mean of both sides."""
    left_thigh, left_shank, right_thigh, right_shank = np.nanmedian(leg_bones(positions), axis=0)
    return float(LEG_LENGTH / (0.5 * (left_thigh + left_shank + right_thigh + right_shank)))


@dataclass(frozen=True)
class Subject:
    """The recorded person: height in metres by average proportions, and the mass in kg of the Table 1 body
    scaled to their size at its own density.
    """

    height: float
    mass: float


def estimate_subject(positions: Array) -> Subject:
    """Height and mass estimated from the legs of (M, 20, 3); medians over frames, robust to outliers."""
    return Subject(stature(positions), TOTAL_MASS / length_scale(positions) ** 3)


def body_kinematics(rotations: Array, root: Array | None = None) -> tuple[Array, Array]:
    """World positions (T, 20, 3) and frames (T, 20, 4) of the body's nodes; root: (T, 3), default 0."""
    offsets = node_offsets()
    translations = np.broadcast_to(offsets, (len(rotations), *offsets.shape)).copy()
    translations[:, 0] = 0.0 if root is None else root
    return forward_kinematics(node_skeleton(offsets), translations, rotations)


def stance_width(positions: Array) -> float:
    """Mean lateral distance in metres between the ankles of positions (T, 20, 3) along +X."""
    return float(np.nanmean(positions[:, N["ankle_left"], 1] - positions[:, N["ankle_right"], 1]))


def body_width(width: float, *, precise: bool) -> float:
    """Metres between the ankles that the body gets for a scaled width in metres.

    precise: whether the recording shows the ankles to a centimetre.
    """
    return max(width, LEAST_WIDTH) if precise else float(np.clip(width, LEAST_WIDTH, MOST_SENSED_WIDTH))


def abduct(rotations: Array, angle: float) -> Array:
    """Local rotations (T, 20, 4) with both thighs turned outward; the feet keep their orientation.

    A sensor sees hips 8 to 14 cm apart, the body's are 17: without correction the humanoid straddles.
    """
    out = rotations.copy()
    for side, sign in _SIDES:
        hip, knee, ankle = (N[f"{joint}_{side}"] for joint in ("hip", "knee", "ankle"))
        turn = from_axis_angle("X", sign * angle)
        out[:, hip] = multiply(turn, rotations[:, hip])
        leg = multiply(rotations[:, hip], rotations[:, knee])
        out[:, ankle] = multiply(
            multiply(conjugate(leg), multiply(conjugate(turn), leg)), rotations[:, ankle]
        )
    return out


def with_stance_width(rotations: Array, width: float) -> tuple[Array, float]:
    """Local rotations (T, 20, 4) abducted so that the mean ankle distance is `width`, and the angle."""
    angle = 0.0
    for _ in range(6):
        width_now = stance_width(body_kinematics(abduct(rotations, angle))[0])
        angle += (width - width_now) / (2.0 * LEG_LENGTH)
    return abduct(rotations, angle), angle
