"""Find the known sequence of joints for which a table without names forms a human body."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.joint_names import REQUIRED, joints_by_name
from kinemimic.pipeline.kinematics.skeleton import NODES
from kinemimic.pipeline.readers.kinect.azure_joints import AZURE_JOINTS
from kinemimic.pipeline.readers.kinect.kinect_v2 import SDK_JOINTS
from kinemimic.pipeline.readers.public_datasets.cad import CAD_JOINTS
from kinemimic.pipeline.readers.public_datasets.msr_action3d import MSR_JOINTS

ORDERS: dict[str, tuple[str, ...]] = {
    "Kinect v1 SDK": NODES,
    "Kinect v2 SDK": SDK_JOINTS,
    "Azure Kinect SDK": AZURE_JOINTS,
    "MSR-Action3D": MSR_JOINTS,
    "Andersson": (
        "head", "shoulder_center", "shoulder_right", "shoulder_left", "elbow_right", "elbow_left",
        "wrist_right", "wrist_left", "hand_right", "hand_left", "spine", "hip_center", "hip_right",
        "hip_left", "knee_right", "knee_left", "ankle_right", "ankle_left", "foot_right", "foot_left",
    ),
    # OpenNI's and NiTE's hands and feet are where a Kinect has wrists and ankles.
    "NiTE": (
        "head", "shoulder_center", "shoulder_left", "shoulder_right", "elbow_left", "elbow_right",
        "wrist_left", "wrist_right", "spine", "hip_left", "hip_right", "knee_left", "knee_right",
        "ankle_left", "ankle_right",
    ),
    "OpenNI": CAD_JOINTS,
    "OpenNI, limb by limb": (
        "head", "shoulder_center", "spine", "shoulder_left", "elbow_left", "wrist_left", "shoulder_right",
        "elbow_right", "wrist_right", "hip_left", "knee_left", "ankle_left", "hip_right", "knee_right",
        "ankle_right",
    ),
    "OpenNI, as in KARD": (
        "head", "shoulder_center", "shoulder_right", "elbow_right", "wrist_right", "shoulder_left",
        "elbow_left", "wrist_left", "spine", "hip_right", "knee_right", "ankle_right", "hip_left",
        "knee_left", "ankle_left",
    ),
}  # fmt: skip
# Columns per joint: position; with a state; with a quaternion; with both.
_JOINT_STEPS = (3, 4, 7, 8)
# Columns that do not belong to a joint: a time, a frame number, features, angles. A sequence that explains
# more columns is preferred: the first 20 joints of a Kinect v2 look much like those of a Kinect v1.
_MAX_SPARE = 26
PENALTY_PER_SPARE = 0.01
_FRAMES = 60
# Bones with their length as a share of an adult's leg (thigh and shank), Winter 2009, Table 4.1 (of stature
# H: leg 0.491, thigh 0.245, shank 0.246, upper arm 0.186, forearm 0.146); the trunk as a Kinect sees it.
_BONES: tuple[tuple[str, str, float], ...] = (
    ("hip", "knee", 0.50),
    ("knee", "ankle", 0.50),
    ("shoulder", "elbow", 0.36),
    ("elbow", "wrist", 0.30),
)
_TRUNK = 0.62
_NEEDED = {f"{joint}_{side}" for bone in _BONES for joint in bone[:2] for side in ("left", "right")} | {
    "shoulder_center"
}
# Below this a body is certain: the right sequence of noisy recordings scores 0.1 to 0.4, any other 0.8 or
# more.
GOOD_SCORE = 0.5
# Above this nothing resembles a body.
_MAX_SCORE = 0.8


@dataclass(frozen=True)
class Order:
    """A sequence of joints found in a table.

    name: a key of ORDERS; first: column of the first joint's x, from 0; step: columns from joint to joint, 0
    if a row holds one joint; score: 0 for a perfect body, below GOOD_SCORE for any body; second: the best
    score of another sequence; spare: columns that do not belong to a joint.
    """

    name: str
    joints: tuple[str, ...]
    first: int
    step: int
    score: float
    second: float
    spare: int = 0


def order_of(values: Array) -> Order | None:
    """The sequence that fits a table (R, w) best, with a row per frame or per joint; None if none fits."""
    found = sorted(_candidates(values), key=lambda order: order.score + PENALTY_PER_SPARE * order.spare)
    if not found or found[0].score > _MAX_SCORE:
        return None
    # A sequence that has the legs in the same columns is no other one: a Kinect v1's in a Kinect v2's.
    others = (order for order in found if order.name != found[0].name and _legs(order) != _legs(found[0]))
    other = next(others, None)
    second = np.inf if other is None else other.score + PENALTY_PER_SPARE * (other.spare - found[0].spare)
    return replace(found[0], second=second)


def _legs(order: Order) -> list[int]:
    """The columns, or rows, of the joints of the legs."""
    index = joints_by_name(order.joints)
    return (
        [order.first + order.step * index[node] for node in REQUIRED]
        if order.step
        else [index[node] for node in REQUIRED]
    )


def order_of_points(points: Array) -> tuple[str, float, float] | None:
    """The sequence that fits points (T, J, 3) best, its score and that of the next (infinite if there is
    none); None if none has that many joints."""
    scores = {
        name: body_score(points, joints) for name, joints in ORDERS.items() if len(joints) == points.shape[1]
    }
    if not scores:
        return None
    name, *others = sorted(scores, key=scores.__getitem__)
    return name, scores[name], scores[others[0]] if others else np.inf


def _candidates(values: Array) -> Iterator[Order]:
    rows, width = values.shape
    for name, joints in ORDERS.items():
        for step in _JOINT_STEPS:
            spare = width - step * len(joints)
            # A second person may follow who is not there, as in PKU-MMD.
            if spare >= step * len(joints) and not values[:, -step * len(joints) :].any():
                spare -= step * len(joints)
            if not 0 <= spare <= _MAX_SPARE:
                continue
            chosen = _sampled(values)
            position_columns = step * np.arange(len(joints))[:, None] + np.arange(3)
            # A state may precede or follow a joint's position.
            for first in range(spare + step - 2):
                score = body_score(chosen[:, first + position_columns], joints)
                yield Order(name, joints, first, step, score, np.inf, spare)
        if width <= _JOINT_STEPS[-1] + 2 and rows >= 2 * len(joints):
            frames = values[: rows // len(joints) * len(joints)].reshape(-1, len(joints), width)
            for first in range(width - 2):
                points = _sampled(frames)[..., first : first + 3]
                yield Order(name, joints, first, 0, body_score(points, joints), np.inf)


def _sampled(values: Array) -> Array:
    """At most _FRAMES rows, spread over the whole length."""
    rows = np.linspace(0, len(values) - 1, min(len(values), _FRAMES)).astype(np.intp)
    return np.asarray(values[np.unique(rows)])


def body_score(points: Array, joints: Sequence[str]) -> float:
    """Distance of points (T, J, 3) from a body with joints of these names; infinite if it cannot be one.

    The sum of the mean relative spread of bone lengths, the mean |log| of left over right, half the mean
    |log| of the bones' lengths over an adult's, and one minus the cosine between trunk and thigh. Independent
    of the unit.
    """
    index = joints_by_name(tuple(joints))
    if not index.keys() >= _NEEDED:
        return float("inf")
    # A coordinate that is always 0, 1 or 2 is a state.
    if np.isin(points, (0.0, 1.0, 2.0)).all(axis=(0, 1)).any():
        return float("inf")

    def length(start: str, end: str) -> Array:
        return np.asarray(np.linalg.norm(points[:, index[start]] - points[:, index[end]], axis=-1))

    pairs = [
        (length(f"{a}_{side}", f"{b}_{side}"), share) for a, b, share in _BONES for side in ("left", "right")
    ]
    hips = [index["hip_center"]] if "hip_center" in index else [index["hip_left"], index["hip_right"]]
    trunk = points[:, index["shoulder_center"]] - points[:, hips].mean(axis=1)
    pairs.append((np.asarray(np.linalg.norm(trunk, axis=-1)), _TRUNK))
    # Zeros and NaN are joints that were not seen; at least half of the frames must have each bone.
    seen = [bone[np.isfinite(bone) & (bone > 0)] for bone, _ in pairs]
    if any(len(bone) < 0.5 * len(points) for bone in seen):
        return float("inf")
    medians = np.array([np.median(bone) for bone in seen])
    spread = np.mean([np.median(np.abs(b - m)) / m for b, m in zip(seen, medians, strict=True)])
    sides = np.abs(np.log(medians[0:8:2] / medians[1:8:2])).mean()
    leg = medians[:4].sum() / 2.0
    shares = np.abs(np.log(medians / leg / [share for _, share in pairs])).mean()
    thigh = points[:, index["hip_left"]] - points[:, index["knee_left"]]
    with np.errstate(invalid="ignore", divide="ignore"):
        along = (
            np.sum(trunk * thigh, axis=-1) / np.linalg.norm(trunk, axis=-1) / np.linalg.norm(thigh, axis=-1)
        )
    # In some frames the trunk is above the thighs, even in squats.
    along = along[np.isfinite(along)]
    folded = 1.0 - max(float(np.percentile(along, 90)), 0.0) if len(along) else 1.0
    return float(spread + sides + 0.5 * shares + folded)
