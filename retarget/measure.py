"""Measures of a motion: foot contact, joint limits, distance from the recording."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.retarget.feet.contact import contact_speeds, sole_positions
from kinemimic.retarget.humanoid.limits import beyond_limits
from kinemimic.retarget.humanoid.motion import Motion

# Chains along which the recorded skeleton is rebuilt with the body's segment lengths: trunk and legs from the
# middle of the hips; arms from their shoulders, which are fixed to the trunk on the body but not on a person.
# Feet are left out: no depth sensor sees them.
_HIPS = "hips"
_CHAINS: tuple[tuple[str, ...], ...] = (
    (_HIPS, "shoulder_center", "head"),
    *(
        tuple(node if node == _HIPS else f"{node}_{side}" for node in chain)
        for side in SIDES
        for chain in ((_HIPS, "hip", "knee", "ankle"), ("shoulder", "elbow", "wrist"))
    ),
)


@dataclass(frozen=True)
class Measures:
    """Measures of a motion.

    foot_speed, foot_speed_95: rms and 95th percentile of the speed (m/s) of feet in contact, NaN without
        contact
    penetration: greatest depth of a sole below the ground, metres
    floating: greatest height of the lower foot while a foot is in contact, metres
    beyond: joint -> radians beyond its limit
    node_error: mean distance of the nodes from the recording rebuilt with the body's lengths, metres
    """

    foot_speed: float
    foot_speed_95: float
    penetration: float
    floating: float
    beyond: dict[str, float]
    node_error: float


def measure(motion: Motion, recorded: Array, phase: Array) -> Measures:
    """Measures of a motion made from recorded positions (M, 20, 3) along +X at phases (M,)."""
    positions, frames = motion.kinematics()
    corners = sole_positions(positions, frames)
    speeds = contact_speeds(
        corners, motion.contacts, motion.rate, motion.cycle_offset if motion.cyclic else None
    )
    height = corners[..., 2].min(axis=-1)
    standing = motion.contacts.any(axis=1)
    return Measures(
        foot_speed=float(np.sqrt(np.mean(speeds**2))) if len(speeds) else float("nan"),
        foot_speed_95=float(np.percentile(speeds, 95)) if len(speeds) else float("nan"),
        penetration=float(max(0.0, -height.min())),
        floating=float(max(0.0, height.min(axis=1)[standing].max(initial=0.0))),
        beyond=beyond_limits(motion.rotations),
        node_error=_node_error(positions, motion.cyclic, recorded, phase),
    )


def _node_error(positions: Array, cyclic: bool, recorded: Array, phase: Array) -> float:
    """Mean distance in metres over nodes and frames, each chain from its own start."""
    frames = len(positions)
    at = np.mod(phase, 1.0) * frames if cyclic else np.clip(phase, 0.0, 1.0) * (frames - 1)
    before = np.minimum(at.astype(np.intp), frames - 1)
    after = np.mod(before + 1, frames) if cyclic else np.minimum(before + 1, frames - 1)
    share = (at - before)[:, None]
    off = []
    for chain in _CHAINS:
        built, own = 0.0, _node(positions, chain[0])
        for start, end in pairwise(chain):
            bone = _node(positions, end) - _node(positions, start)
            seen = _node(recorded, end) - _node(recorded, start)
            size = np.linalg.norm(seen, axis=-1, keepdims=True)
            length = np.median(np.linalg.norm(bone, axis=-1))
            built = built + length * np.divide(seen, size, out=np.full_like(seen, np.nan), where=size > 0)
            reached = _node(positions, end) - own
            here = (1.0 - share) * reached[before] + share * reached[after]
            off.append(np.linalg.norm(here - built, axis=-1))
    every = np.concatenate(off)
    every = every[np.isfinite(every)]
    return float(every.mean()) if len(every) else float("nan")


def _node(positions: Array, name: str) -> Array:
    if name == _HIPS:
        return np.asarray(0.5 * (positions[:, N["hip_left"]] + positions[:, N["hip_right"]]))
    return np.asarray(positions[:, N[name]])
