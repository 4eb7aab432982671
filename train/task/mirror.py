"""Mirroring: the second half of a gait cycle as the reflected first half, so that a policy learns one side.

In the second half the policy observes the humanoid reflected in the sagittal plane, half a cycle earlier, and
its action is reflected back (the "phase" method of Abdolhosseini et al. 2019, On Learning Symmetric
Locomotion). The reference need not be perfectly symmetric: the observation has the difference to its next
pose. A tracker knows no phase: it reflects where the left foot of its reference is behind the right one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import angle_between, rotate
from kinemimic.retarget.humanoid.body import BODY_INDEX, BODY_NAMES
from kinemimic.train.config.env_config import EnvConfig
from kinemimic.train.reference.reference import Reference
from kinemimic.train.sim.world import BodyStates
from kinemimic.train.task.obstacle_observation import obstacle_reflection
from kinemimic.train.task.reward import pose

# Largest `asymmetry` of a mirrored gait. The walk and run of the pybullet wheel have 0.6 and 1.2 degrees,
# five walks and runs of CMU 3 to 8, a Kinect's walk of one and a third strides 8.
MAX_ASYMMETRY = float(np.radians(12.0))

# Signs of a reflection at y = 0: of a vector's x, y, z, of a rotation axis, and of a quaternion.
VECTOR, AXIS = np.array([1.0, -1.0, 1.0]), np.array([-1.0, 1.0, -1.0])
QUATERNION = np.append(AXIS, 1.0)

_OTHER = {"left": "right", "right": "left"}


def _across(name: str) -> str:
    limb, _, side = name.rpartition("_")
    return f"{limb}_{_OTHER[side]}" if side in _OTHER else name


# The reflected body of each body (15,), and joint of each joint (14,).
COUNTERPARTS: NDArray[np.intp] = np.array([BODY_INDEX[_across(name)] for name in BODY_NAMES])
JOINT_COUNTERPARTS: NDArray[np.intp] = COUNTERPARTS[1:] - 1
_LEFT_FOOT, _RIGHT_FOOT = BODY_INDEX["foot_left"], BODY_INDEX["foot_right"]
_LEGS = [k for k, name in enumerate(BODY_NAMES) if name.partition("_")[0] in ("thigh", "shin", "foot")]


def _per_body(bodies: NDArray[np.intp], signs: Array) -> tuple[NDArray[np.intp], Array]:
    """Sources and signs (N,) of a part of the observation with numbers of signs (n,) for every body."""
    size = len(signs)
    return (bodies[:, None] * size + np.arange(size)).ravel(), np.tile(signs, len(bodies))


def action_reflection() -> tuple[NDArray[np.intp], Array]:
    """Index and sign (42,) that reflect an action."""
    return _per_body(JOINT_COUNTERPARTS, AXIS)


def observation_reflection(config: EnvConfig) -> tuple[NDArray[np.intp], Array]:
    """Index and sign (O,) that reflect an observation (`ImitationBatch.observe`) and shift its phase, if it
    has one, by half a cycle."""
    previews = len(config.preview)
    tracking = config.tracking is not None
    first: list[tuple[NDArray[np.intp], Array]]
    if tracking:
        # The height; rotations to the reference.
        first = [(np.arange(1), np.ones(1)), _per_body(COUNTERPARTS, AXIS)]
    else:
        first = [(np.arange(3), np.array([-1.0, -1.0, 1.0]))]  # sine, cosine half a cycle away; the height
    parts = [
        *first,
        # The x-axis and the y-axis of a body; the y-axis changes its direction too.
        _per_body(COUNTERPARTS, np.concatenate([VECTOR, -VECTOR])),
        _per_body(JOINT_COUNTERPARTS, VECTOR),
        _per_body(COUNTERPARTS, VECTOR),
        _per_body(COUNTERPARTS, AXIS),
        *([_per_body(COUNTERPARTS, signs) for signs in (VECTOR, VECTOR, AXIS)] if tracking else []),
        *[_per_body(COUNTERPARTS, AXIS)] * previews,
        *[(np.arange(2), VECTOR[:2])] * previews,
    ]
    if config.observed_obstacles:
        parts.append(obstacle_reflection(config.observed_obstacles))
    starts = np.cumsum([0, *(len(sources) for sources, _ in parts[:-1])])
    sources = np.concatenate([part + start for (part, _), start in zip(parts, starts, strict=True)])
    return sources, np.concatenate([signs for _, signs in parts])


class Mirror:
    """Reflects rows of observations (E, O) and actions (E, 42) in place; twice is the identity."""

    def __init__(self, config: EnvConfig) -> None:
        self._observation, self._action = observation_reflection(config), action_reflection()

    def observations(self, observations: Array, rows: NDArray[np.bool_]) -> None:
        """Reflect these rows, a mask (E,), half a cycle away."""
        _reflect(observations, rows, *self._observation)

    def actions(self, actions: Array, rows: NDArray[np.bool_]) -> None:
        """Reflect the actions of these rows, a mask (E,)."""
        _reflect(actions, rows, *self._action)


def _reflect(values: Array, rows: NDArray[np.bool_], sources: NDArray[np.intp], signs: Array) -> None:
    values[rows] = values[rows][:, sources] * signs


def mirrored(config: EnvConfig, reference: Reference) -> bool:
    """Whether a policy of this configuration mirrors this reference."""
    if config.tracking is not None:
        return config.mirror
    return config.mirror and bool(asymmetry(reference) <= MAX_ASYMMETRY)


def reflected_rows(config: EnvConfig, phases: Array, target: BodyStates) -> NDArray[np.bool_]:
    """(E,) whether a policy that mirrors sees the mirror image; target: its reference at phases (E,)."""
    return np.mod(phases, 1.0) >= 0.5 if config.tracking is None else left_foot_behind(target)


def left_foot_behind(bodies: BodyStates) -> NDArray[np.bool_]:
    """(E,) whether the left foot is behind the right one, along the pelvis' forward axis."""
    stride = bodies.positions[:, _LEFT_FOOT] - bodies.positions[:, _RIGHT_FOOT]
    forward = rotate(bodies.rotations[:, 0], np.broadcast_to([1.0, 0.0, 0.0], stride.shape))
    return np.asarray(stride[:, 0] * forward[:, 0] + stride[:, 1] * forward[:, 1] < 0.0)


def asymmetry(reference: Reference) -> float:
    """Mean angle between the joints of the legs and their mirror image half a cycle away, rad; infinite for a
    non-cyclic motion."""
    if not reference.cyclic:
        return float("inf")
    phases = np.arange(60) / 60
    now, away = (pose(reference.bodies(at).rotations) for at in (phases, phases + 0.5))
    return float(np.mean(angle_between(now, away[:, COUNTERPARTS] * QUATERNION)[:, _LEGS]))
