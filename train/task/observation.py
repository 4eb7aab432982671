"""What a policy observes: the humanoid in its own heading, and the difference to its reference.

`observation_layout.py` describes the numbers one by one.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import to_6d
from kinemimic.train.config.env_config import EnvConfig
from kinemimic.train.sim.world import BodyStates
from kinemimic.train.task.heading_frame import in_heading_frame
from kinemimic.train.task.obstacle_observation import (
    ObstacleStates,
    observe_obstacles,
    obstacle_observation_size,
)


def observation_size(config: EnvConfig) -> int:
    """Size of an observation: phase, height, the bodies, and the difference to each pose of the preview; a
    tracker's has no phase, but the difference to the reference now; last, the obstacles if observed."""
    body = 1 + 15 * 6 + 14 * 3 + 15 * 3 + 15 * 3
    preview = len(config.preview) * (15 * 3 + 2)
    first = 2 if config.tracking is None else 4 * 15 * 3
    return body + preview + first + obstacle_observation_size(config.observed_obstacles)


OBSERVATIONS = observation_size(EnvConfig())


def observe(
    config: EnvConfig,
    phases: Array,
    cyclic: bool | NDArray[np.bool_],
    bodies: BodyStates,
    target: BodyStates,
    ahead: Sequence[BodyStates],
    turns: Array,
    turns_ahead: Sequence[Array],
    obstacles: ObstacleStates | None = None,
) -> Array:
    """(E, O) in the humanoid's own heading: its state and the difference to the next poses.

    cyclic: whether the motion is, (E,) where motions differ; target: the reference now; ahead: the poses of
    the preview; turns, turns_ahead: of `reward.pose_turns`, to the target and to each of the preview;
    obstacles: all that are there, None if there are none or the policy observes none.
    """
    size, previews = len(phases), len(ahead)
    six = to_6d(bodies.rotations)
    beyond = np.zeros((size, 1, 3))
    differences: list[Array] = []
    if config.tracking is not None:
        beyond = _beyond_leash(bodies, target, config.tracking.leash)
        differences = _differences(bodies, target, beyond)
    vectors = np.concatenate(
        [
            six.reshape(size, -1, 3),
            bodies.positions[:, 1:] - bodies.positions[:, :1],
            bodies.linear,
            bodies.angular,
            *differences,
            *(pose.positions[:, :1] - bodies.positions[:, :1] - beyond for pose in ahead),
        ],
        axis=1,
    )
    # The pelvis faces along its x-axis.
    heading = np.arctan2(six[:, 0, 1], six[:, 0, 0])
    vectors = in_heading_frame(vectors, heading)
    if config.tracking is None:
        # A cycle ends where it begins; in a non-cyclic motion, start and end must differ.
        angle = np.where(cyclic, 2.0 * np.pi * phases, np.pi * np.minimum(phases, 1.0))
        first = [np.array([np.sin(angle), np.cos(angle), bodies.positions[:, 0, 2]]).T]
    else:
        first = [bodies.positions[:, :1, 2], turns.reshape(size, -1)]
    parts = [
        *first,
        vectors[:, :-previews].reshape(size, -1),
        *(turn.reshape(size, -1) for turn in turns_ahead),
        np.minimum(np.maximum(vectors[:, -previews:, :2], -1.0), 1.0).reshape(size, -1),
    ]
    if config.observed_obstacles:
        parts.append(observe_obstacles(config.observed_obstacles, obstacles, bodies, heading))
    return np.concatenate(parts, axis=1)


def _beyond_leash(bodies: BodyStates, target: BodyStates, leash: float) -> Array:
    """(E, 1, 3) part of the horizontal vector to the reference that exceeds the leash; a tracker does not
    observe it. A humanoid that fell behind keeps walking, instead of observing what it never learned."""
    way = (target.positions[:, :1] - bodies.positions[:, :1]) * [1.0, 1.0, 0.0]
    distance = np.maximum(np.linalg.norm(way, axis=-1, keepdims=True), leash)
    beyond: Array = way * (1.0 - leash / distance)
    return beyond


def _differences(bodies: BodyStates, target: BodyStates, beyond: Array) -> list[Array]:
    """What a tracker observes: differences (E, 15, 3) from the bodies to their reference, in position, within
    1 m and without the part `beyond` the leash, velocity and angular velocity."""
    return [
        np.clip(target.positions - bodies.positions - beyond, -1.0, 1.0),
        target.linear - bodies.linear,
        target.angular - bodies.angular,
    ]
