"""Which of the known sequences of joints a table without names has: the one that makes it a human body."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.nodes import joints_of_nodes
from kinemimic.pipeline.kinematics.skeleton import NODES
from kinemimic.pipeline.readers.kinect.azure_joints import JOINTS as AZURE
from kinemimic.pipeline.readers.kinect.kinect_v2 import SDK_JOINTS
from kinemimic.pipeline.readers.public_datasets.msr_action3d import JOINTS as MSR

ORDERS: dict[str, tuple[str, ...]] = {
    "Kinect v1 SDK": NODES,
    "Kinect v2 SDK": tuple(SDK_JOINTS),
    "Azure Kinect SDK": tuple(AZURE),
    "MSR-Action3D": tuple(MSR),
    "Andersson": (
        "head", "shoulder_center", "shoulder_right", "shoulder_left", "elbow_right", "elbow_left",
        "wrist_right", "wrist_left", "hand_right", "hand_left", "spine", "hip_center", "hip_right",
        "hip_left", "knee_right", "knee_left", "ankle_right", "ankle_left", "foot_right", "foot_left",
    ),
}  # fmt: skip
# Columns of a joint: place; and a state; and a quaternion; and both.
STEPS = (3, 4, 7, 8)
# Columns that are no joint's: a time, a frame number, features, angles. One that explains more columns is
# better: the first 20 joints of a Kinect v2 look much like those of a Kinect v1.
_EXTRA = 26
_PER_EXTRA = 0.01
_FRAMES = 60
# Bones with their share of a leg (thigh and shank) in an adult, Winter 2009, Table 4.1 (of stature H: leg
# 0.491, thigh 0.245, shank 0.246, upper arm 0.186, forearm 0.146), trunk as a Kinect sees it.
_BONES: tuple[tuple[str, str, float], ...] = (
    ("hip", "knee", 0.50),
    ("knee", "ankle", 0.50),
    ("shoulder", "elbow", 0.36),
    ("elbow", "wrist", 0.30),
)
_TRUNK = 0.62
_NEEDED = {f"{joint}_{side}" for bone in _BONES for joint in bone[:2] for side in ("left", "right")} | {
    "hip_center",
    "shoulder_center",
}
# Below this a body is certain; the real sequence of noisy recordings gives 0.1 to 0.4, any other 0.8 or more.
SURE = 0.5
# From here on nothing is like a body.
HOPELESS = 0.8


@dataclass(frozen=True)
class Order:
    """A sequence of joints found in a table: name: of ORDERS; first: column of the first joint's place, from
    0; step: columns from joint to joint, 0 where a row holds one joint; score: 0 for a perfect body, below
    SURE for any; second: the best score of another sequence; spare: columns that belong to no joint."""

    name: str
    joints: tuple[str, ...]
    first: int
    step: int
    score: float
    second: float
    spare: int = 0


def order_of(values: Array) -> Order | None:
    """The sequence that fits a table (R, w) best, a row a frame or a row a joint; None if none can."""
    found = sorted(_candidates(values), key=lambda order: order.score + _PER_EXTRA * order.spare)
    if not found or found[0].score > HOPELESS:
        return None
    other = next((order for order in found if order.name != found[0].name), None)
    second = np.inf if other is None else other.score + _PER_EXTRA * (other.spare - found[0].spare)
    return replace(found[0], second=second)


def order_of_points(points: Array) -> tuple[str, float] | None:
    """The sequence that fits points (T, J, 3) best and its score; None if none has so many joints."""
    scores = {
        name: body_score(points, joints) for name, joints in ORDERS.items() if len(joints) == points.shape[1]
    }
    if not scores:
        return None
    name = min(scores, key=lambda key: scores[key])
    return name, scores[name]


def _candidates(values: Array) -> Iterator[Order]:
    rows, width = values.shape
    for name, joints in ORDERS.items():
        for step in STEPS:
            spare = width - step * len(joints)
            if not 0 <= spare <= _EXTRA:
                continue
            chosen = _spread(values)
            places = step * np.arange(len(joints))[:, None] + np.arange(3)
            # A state may stand before a joint's place, as well as behind it.
            for first in range(width - int(places.max())):
                score = body_score(chosen[:, first + places], joints)
                yield Order(name, joints, first, step, score, np.inf, spare)
        if width <= STEPS[-1] + 2 and rows >= 2 * len(joints):
            frames = values[: rows // len(joints) * len(joints)].reshape(-1, len(joints), width)
            for first in range(width - 2):
                points = _spread(frames)[..., first : first + 3]
                yield Order(name, joints, first, 0, body_score(points, joints), np.inf)


def _spread(values: Array) -> Array:
    """At most _FRAMES rows from the whole length."""
    rows = np.linspace(0, len(values) - 1, min(len(values), _FRAMES)).astype(np.intp)
    return np.asarray(values[np.unique(rows)])


def body_score(points: Array, joints: Sequence[str]) -> float:
    """How far points (T, J, 3) are from a body whose joints have these names; infinite for none at all.

    Sum of the mean relative spread of bone lengths, the mean |log| of left over right, half the mean |log|
    of the bones' lengths over an adult's, and one minus the cosine between trunk and thigh; no unit is
    needed.
    """
    index = joints_of_nodes(tuple(joints))
    if not index.keys() >= _NEEDED:
        return float("inf")
    # A coordinate that is 0, 1 or 2 at all times is a state.
    if np.isin(points, (0.0, 1.0, 2.0)).all(axis=(0, 1)).any():
        return float("inf")

    def length(start: str, end: str) -> Array:
        return np.asarray(np.linalg.norm(points[:, index[start]] - points[:, index[end]], axis=-1))

    pairs = [
        (length(f"{a}_{side}", f"{b}_{side}"), share) for a, b, share in _BONES for side in ("left", "right")
    ]
    pairs.append((length("hip_center", "shoulder_center"), _TRUNK))
    # Zeros and NaN are joints that were not seen; a table has bones in at least half of its frames.
    seen = [bone[np.isfinite(bone) & (bone > 0)] for bone, _ in pairs]
    if any(len(bone) < 0.5 * len(points) for bone in seen):
        return float("inf")
    medians = np.array([np.median(bone) for bone in seen])
    spread = np.mean([np.median(np.abs(b - m)) / m for b, m in zip(seen, medians, strict=True)])
    sides = np.abs(np.log(medians[0:8:2] / medians[1:8:2])).mean()
    leg = medians[:4].sum() / 2.0
    shares = np.abs(np.log(medians / leg / [share for _, share in pairs])).mean()
    trunk = points[:, index["shoulder_center"]] - points[:, index["hip_center"]]
    thigh = points[:, index["hip_left"]] - points[:, index["knee_left"]]
    with np.errstate(invalid="ignore", divide="ignore"):
        along = (
            np.sum(trunk * thigh, axis=-1) / np.linalg.norm(trunk, axis=-1) / np.linalg.norm(thigh, axis=-1)
        )
    # At one time or other the trunk stands above the thighs, even in squats.
    along = along[np.isfinite(along)]
    folded = 1.0 - max(float(np.percentile(along, 90)), 0.0) if len(along) else 1.0
    return float(spread + sides + 0.5 * shares + folded)
