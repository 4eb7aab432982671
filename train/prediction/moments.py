"""A moment of a motion in numbers: the newest pose, how it came about, and how it goes on.

Changes are relative to the newest frame, so that they are the same wherever the person is and whichever way
the person faces: displacements of the root in its heading frame, joint rotations relative to the newest ones.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import (
    conjugate,
    from_axis_angle,
    from_rotvec,
    multiply,
    rotate,
    to_6d,
    to_rotvec,
)
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.retarget.humanoid.body import BODIES

# Frames before the newest whose changes are observed: of a precise capture, and of a noisy one, whose noise
# must average out.
PAST = (1, 2, 3, 5, 8, 12)
NOISY_PAST = (1, 2, 3, 4, 6, 8, 11, 15, 20, 25, 30)
FUTURE = 12  # frames that are predicted
CHANGES = 3 + 3 * len(BODIES)  # numbers of a change
_MOVING = [NODE_INDEX[body.node] for body in BODIES]  # nodes with a rotation of their own; the root is first


def observations(past: Sequence[int]) -> int:
    """How many numbers a moment has."""
    return 4 + 6 * (len(BODIES) - 1) + len(past) * CHANGES


def observed(root: Array, rotations: Array, past: Sequence[int]) -> Array:
    """Numbers (..., observations(past)) of moments: root (..., F, 3) m, rotations (..., F, 20, 4), the newest
    last.

    The height of the hips, the direction of gravity in the pelvis' frame, two axes of every joint, and the
    changes since the frames in `past`; F is at least the largest of them, plus 1.
    """
    newest_root, newest = root[..., -1, :], rotations[..., -1, :, :]
    pelvis = newest[..., 0, :]
    gravity = rotate(conjugate(pelvis), np.broadcast_to([0.0, 0.0, 1.0], (*pelvis.shape[:-1], 3)))
    before = [-1 - frames for frames in past]
    parts = (
        to_6d(newest[..., _MOVING[1:], :]),
        changes(root[..., before, :], rotations[..., before, :, :], newest_root, newest),
    )
    flat = (part.reshape(*pelvis.shape[:-1], -1) for part in parts)
    return np.concatenate([newest_root[..., 2:], gravity, *flat], axis=-1)


def changes(root: Array, rotations: Array, newest_root: Array, newest_rotations: Array) -> Array:
    """Changes (..., F, CHANGES) from the newest frame to others.

    root, rotations: (..., F, 3), (..., F, 20, 4) of the others; newest_*: (..., 3), (..., 20, 4).
    """
    newest = newest_rotations[..., None, _MOVING, :]
    way = rotate(conjugate(heading(newest[..., 0, :])), root - newest_root[..., None, :])
    turns = to_rotvec(multiply(conjugate(newest), rotations[..., _MOVING, :]))
    return np.concatenate([way, turns.reshape(*way.shape[:-1], -1)], axis=-1)


def changed(newest_root: Array, newest_rotations: Array, change: Array) -> tuple[Array, Array]:
    """The frames (F, 3), (F, 20, 4) that changes (F, CHANGES) from the newest one lead to."""
    root = newest_root + rotate(heading(newest_rotations[0]), change[:, :3])
    rotations = np.repeat(newest_rotations[None], len(change), axis=0)
    turns = from_rotvec(change[:, 3:].reshape(len(change), len(BODIES), 3))
    rotations[:, _MOVING] = multiply(rotations[:, _MOVING], turns)
    return root, rotations


def corrections(root: Array, rotations: Array, noisy_root: Array, noisy: Array) -> Array:
    """Changes (..., 1 + F, CHANGES) that turn the newest frame of a noisy motion into the true one, and into
    those after it.

    root, rotations: (..., 2 + F, 3), (..., 1 + F, 20, 4), the truth from the frame before the newest on, and
    from the newest on; noisy_root, noisy: (..., 3), (..., 20, 4), the newest frame as captured. On the
    ground, the newest frame is relative to the one before, and those after it to the newest: noise hides
    where a person is, but not how far a person goes.
    """
    found = changes(root[..., 1:, :], rotations, noisy_root, noisy)
    newest = root[..., 1:2, :]
    way = np.concatenate([newest - root[..., :1, :], root[..., 2:, :] - newest], axis=-2)
    found[..., :2] = rotate(conjugate(heading(noisy[..., 0, :]))[..., None, :], way)[..., :2]
    return found


def corrected(noisy_root: Array, noisy: Array, change: Array) -> tuple[Array, Array]:
    """The frames (1 + F, 3), (1 + F, 20, 4) of `corrections` (1 + F, CHANGES).

    noisy_root: (2, 3) of the frame before the newest, and of the newest; noisy: (20, 4) of the newest.
    """
    root, rotations = changed(noisy_root[1], noisy, change)
    root[:, :2] -= noisy_root[1, :2]
    root[0, :2] += noisy_root[0, :2]
    root[1:, :2] += root[0, :2]
    return root, rotations


def heading(pelvis: Array) -> Array:
    """Rotation (..., 4) about the vertical that turns x to where a pelvis faces."""
    ahead = rotate(pelvis, np.broadcast_to([1.0, 0.0, 0.0], (*pelvis.shape[:-1], 3)))
    return from_axis_angle("Z", np.arctan2(ahead[..., 1], ahead[..., 0]))
