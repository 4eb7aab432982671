"""The path of a body whose joints deviate from a gait cycle: it follows from the feet in stance.

A stride with a larger swing of the hips is longer, and a leg that is bent more carries the pelvis lower. The
standing foot moves over the ground as it does in the recorded cycle (it rolls), not as a model would have it.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import forward_kinematics
from kinemimic.pipeline.kinematics.rotations import conjugate, from_axis_angle, from_rotvec, multiply, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import NODES, SIDES, Skeleton
from kinemimic.pipeline.virtual_kinect.subject import Gait

_HIPS, _KNEES, _ANKLES = ([N[f"{joint}_{side}"] for side in SIDES] for joint in ("hip", "knee", "ankle"))
# Heel and toe in the ankle's frame, metres; the lower one of them carries the foot.
_SOLE = np.array([[-0.05, 0.0, -0.05], [0.12, 0.0, -0.05]])
# Metres by which a foot must be higher than the other to carry a third of the weight of the lower one.
_LIFT = 0.015


def follow_feet(
    gait: Gait, phase: Array, vectors: Array, heading: Array, *, inertia: float, closed: bool = False
) -> tuple[Array, Array]:
    """The root (T, 3) in metres and local rotations (T, 20, 4) of a body that deviates from its gait.

    phase: (T,) of the gait that is deviated from; vectors: (T, 20, 3) rotation vectors of the nodes; heading:
    (T,) radians; inertia: frames, the standard deviation of a Gaussian that smooths the pelvis' deviation
    from its path, since a body has mass; closed: the deviation is periodic. The thighs turn with the pelvis
    as much as the standing feet need, and the feet keep the cycle's own orientation. Starts at the root of
    the gait.
    """
    root, recorded = gait.pose(phase)
    before, orientation, _ = _legs(gait.skeleton, recorded)
    placed = root[:, None] + before
    weights = _support(placed, orientation)
    turn = from_axis_angle("Z", heading)
    path = root[0] + _sum(rotate(_between(heading), np.diff(root, axis=0)))

    rotations = from_rotvec(vectors)
    # Where the pelvis deviates, the thighs keep their direction in space.
    pelvis, own = rotations[:, :1], multiply(recorded[:, :1], rotations[:, _HIPS])
    rotations[:, _HIPS] = multiply(conjugate(pelvis), own)
    feet, _, _ = _legs(gait.skeleton, rotations)
    # Metres that the pelvis must leave its path for so that the standing feet move as in the cycle.
    step = rotate(_between(heading)[:, None], np.diff(placed, axis=0)) - np.diff(
        rotate(turn[:, None], feet), axis=0
    )
    exact = root[0] + _sum(np.einsum("tf,tfk->tk", 0.5 * (weights[1:] + weights[:-1]), step)) - path
    deviation = _smoothed(exact, inertia, closed=closed)
    missing = weights[..., None] * rotate(conjugate(turn), exact - deviation)[:, None]
    rotations[:, _HIPS] = multiply(
        conjugate(pelvis), multiply(_reaching(gait.skeleton, pelvis, feet, missing), own)
    )

    feet, _, shanks = _legs(gait.skeleton, rotations)
    rotations[:, _ANKLES] = multiply(conjugate(shanks), orientation)
    height = np.einsum("tf,tf->t", weights, placed[..., 2] - feet[..., 2]) - path[:, 2]
    deviation[:, 2] = _smoothed(height[:, None], inertia, closed=closed)[:, 0]
    return path + deviation, rotations


def _between(heading: Array) -> Array:
    """Rotations (T - 1, 4) about the vertical, halfway between consecutive headings."""
    return from_axis_angle("Z", 0.5 * (heading[1:] + heading[:-1]))


def _sum(steps: Array) -> Array:
    """Positions (T, n) from the origin after steps (T - 1, n)."""
    return np.concatenate([np.zeros((1, steps.shape[1])), np.cumsum(steps, axis=0)])


def _smoothed(values: Array, width: float, *, closed: bool) -> Array:
    """Values (T, n) under a Gaussian; closed: periodic but for an even advance, last = first."""
    even = np.linspace(values[0], values[-1], len(values))
    rest = values - even
    if not closed:
        return np.asarray(even + gaussian_filter1d(rest, width, axis=0, mode="nearest"))
    smooth = gaussian_filter1d(rest[:-1], width, axis=0, mode="wrap")
    return np.asarray(even + np.concatenate([smooth, smooth[:1]]))


def _reaching(skeleton: Skeleton, pelvis: Array, feet: Array, missing: Array) -> Array:
    """Rotations (T, 2, 4) of the legs as a whole that move the feet (T, 2, 3) by `missing`, horizontally."""
    hips = rotate(pelvis, skeleton.offsets[_HIPS])
    leg = feet - hips
    length = np.linalg.norm(leg, axis=-1)
    wanted = leg + missing
    flat = np.minimum(np.hypot(wanted[..., 0], wanted[..., 1]), 0.95 * length)
    wanted[..., 2] = -np.sqrt(length**2 - flat**2)
    axis = np.cross(leg, wanted)
    sine, cosine = np.linalg.norm(axis, axis=-1), np.sum(leg * wanted, axis=-1)
    angle = np.arctan2(sine, cosine)
    return from_rotvec(axis * (angle / np.maximum(sine, 1e-12))[..., None])


def _legs(skeleton: Skeleton, rotations: Array) -> tuple[Array, Array, Array]:
    """Ankles (T, 2, 3) about the root, and the world frames (T, 2, 4) of the feet and of the shanks."""
    translations = np.broadcast_to(skeleton.offsets, (len(rotations), len(NODES), 3)).copy()
    translations[:, 0] = 0.0
    positions, world = forward_kinematics(skeleton, translations, rotations)
    return positions[:, _ANKLES], world[:, _ANKLES], world[:, _KNEES]


def _support(ankles: Array, orientation: Array) -> Array:
    """Share (T, 2) of the weight that each foot carries, from the heights of the soles."""
    soles = ankles[:, :, None] + rotate(orientation[:, :, None], _SOLE)
    low = soles[..., 2].min(axis=-1)
    return np.asarray(1.0 / (1.0 + np.exp(np.clip((low - low[:, ::-1]) / _LIFT, -50.0, 50.0))))
