"""The second half of a gait's cycle as its first half in a mirror: a policy then learns one side for both.

In the second half it is given the figure as a mirror in the sagittal plane shows it, half a cycle earlier,
and what it answers is taken back through the mirror (the "phase" method of Abdolhosseini et al. 2019, On
Learning Symmetric Locomotion). The reference need not be quite symmetric: how it differs stands in the
observation, as the way to its next pose.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import angle_between
from kinemimic.retarget.humanoid.body import BODY_INDEX, BODY_NAMES
from kinemimic.train.config.config import EnvConfig
from kinemimic.train.reference.reference import Reference
from kinemimic.train.task.reward import pose

# `asymmetry` up to which two halves of a cycle are taken for one. Walk and run of the wheel have 0.6 and 1.2
# degrees, five walks and runs of CMU 3 to 8, a Kinect's of one and a third strides 8.
MAX_ASYMMETRY = float(np.radians(12.0))

# What a mirror at y = 0 makes of x, y, z of a vector, of an axis that something turns about, of a quaternion.
VECTOR, AXIS = np.array([1.0, -1.0, 1.0]), np.array([-1.0, 1.0, -1.0])
QUATERNION = np.append(AXIS, 1.0)

_OTHER = {"left": "right", "right": "left"}


def _across(name: str) -> str:
    limb, _, side = name.rpartition("_")
    return f"{limb}_{_OTHER[side]}" if side in _OTHER else name


# (15,) the body that each becomes in a mirror; (14,) the joint.
COUNTERPARTS: NDArray[np.intp] = np.array([BODY_INDEX[_across(name)] for name in BODY_NAMES])
JOINT_COUNTERPARTS: NDArray[np.intp] = COUNTERPARTS[1:] - 1
_LEGS = [k for k, name in enumerate(BODY_NAMES) if name.partition("_")[0] in ("thigh", "shin", "foot")]


def _per_body(bodies: NDArray[np.intp], signs: Array) -> tuple[NDArray[np.intp], Array]:
    """Sources and signs (N,) of a part of the observation that has numbers like signs (n,) for every body."""
    size = len(signs)
    return (bodies[:, None] * size + np.arange(size)).ravel(), np.tile(signs, len(bodies))


def action_reflection() -> tuple[NDArray[np.intp], Array]:
    """For each of the 42 numbers of an action which one it becomes in the mirror, and with which sign."""
    return _per_body(JOINT_COUNTERPARTS, AXIS)


def observation_reflection(previews: int) -> tuple[NDArray[np.intp], Array]:
    """For each of the O numbers of an observation (`ImitationBatch.observe`) which one it becomes in the
    mirror, half a cycle away, and with which sign; both (O,)."""
    parts = [
        (np.arange(3), np.array([-1.0, -1.0, 1.0])),  # sine and cosine half a cycle away; the height
        # The x-axis of a body and its y-axis, which the mirror turns round beside.
        _per_body(COUNTERPARTS, np.concatenate([VECTOR, -VECTOR])),
        _per_body(JOINT_COUNTERPARTS, VECTOR),
        _per_body(COUNTERPARTS, VECTOR),
        _per_body(COUNTERPARTS, AXIS),
        *[_per_body(COUNTERPARTS, AXIS)] * previews,
        *[(np.arange(2), VECTOR[:2])] * previews,
    ]
    starts = np.cumsum([0, *(len(sources) for sources, _ in parts[:-1])])
    sources = np.concatenate([part + start for (part, _), start in zip(parts, starts, strict=True)])
    return sources, np.concatenate([signs for _, signs in parts])


class Mirror:
    """Changes rows of observations (E, O) and actions (E, 42) in place; twice is not at all."""

    def __init__(self, previews: int) -> None:
        self._observation, self._action = observation_reflection(previews), action_reflection()

    def observations(self, observations: Array, rows: NDArray[np.bool_]) -> None:
        """Show the figures of these rows, (E,) True, as the mirror does, half a cycle away."""
        _reflect(observations, rows, *self._observation)

    def actions(self, actions: Array, rows: NDArray[np.bool_]) -> None:
        """Take the corrections of these rows, (E,) True, through the mirror."""
        _reflect(actions, rows, *self._action)


def _reflect(values: Array, rows: NDArray[np.bool_], sources: NDArray[np.intp], signs: Array) -> None:
    values[rows] = values[rows][:, sources] * signs


def mirrored(config: EnvConfig, reference: Reference) -> bool:
    """Whether a policy of this configuration performs this reference by way of a mirror."""
    return config.mirror and bool(asymmetry(reference) <= MAX_ASYMMETRY)


def asymmetry(reference: Reference) -> float:
    """Mean angle in radians between the joints of the legs and their mirror image half a cycle away; infinite
    for what is performed once."""
    if not reference.cyclic:
        return float("inf")
    phases = np.arange(60) / 60
    now, away = (pose(reference.bodies(at).rotations) for at in (phases, phases + 0.5))
    return float(np.mean(angle_between(now, away[:, COUNTERPARTS] * QUATERNION)[:, _LEGS]))
