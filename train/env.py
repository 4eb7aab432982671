"""The imitation task on a batch of figures: observation, action, reward, end of an episode."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.rotations import (
    conjugate,
    from_axis_angle,
    from_rotvec,
    multiply,
    rotate,
    to_rotvec,
    to_six,
)
from kinemimic.retarget.body import BODIES
from kinemimic.train.config import EnvConfig
from kinemimic.train.reference import Reference
from kinemimic.train.reward import rewards
from kinemimic.train.world import CONTROL_RATE, SUBSTEPS, TIME_STEP, BodyStates, World

Array = NDArray[np.float64]

JOINTS = len(BODIES) - 1
ACTIONS = 3 * JOINTS
# Radians of correction per unit of action: the legs and the trunk balance, the arms only hang.
_REACH = {
    "torso": 1.0,
    "head": 0.1,
    "upper_arm": 0.1,
    "forearm": 0.1,
    "hand": 0.03,
    "thigh": 1.0,
    "shin": 1.0,
    "foot": 1.0,
}
ACTION_SCALE: Array = np.repeat(
    [_REACH[body.name.removesuffix("_left").removesuffix("_right")] for body in BODIES[1:]], 3
)
OBSERVATIONS = 2 + 1 + 15 * 6 + 14 * 3 + 15 * 3 + 15 * 3 + 15 * 3 + 2


@dataclass(frozen=True)
class Step:
    """Result of a control step for E figures.

    observations: (E, OBSERVATIONS) after the step, before any reset; terms: (E, K) reward terms;
    terminated: (E,) fell or lost the reference; truncated: (E,) time is up (not a fall).
    """

    observations: Array
    terms: Array
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]


class ImitationBatch:
    """E figures that imitate one reference. Time of each is its phase in the reference, not wrapped."""

    def __init__(self, world: World, reference: Reference, config: EnvConfig) -> None:
        self.world = world
        self.reference = reference
        self.config = config
        self.reward = config.reward  # may be changed between steps
        self.phases: Array = np.zeros(world.size)
        self._ages = np.zeros(world.size, dtype=np.int64)
        self._increment = 1.0 / (CONTROL_RATE * reference.duration)
        self.bodies: BodyStates = world.states()

    def reset(self, indices: NDArray[np.intp], phases: Array) -> None:
        """Put figures (N,) on the reference at phases (N,)."""
        self.phases[indices] = phases
        self._ages[indices] = 0
        self.world.reset(indices, self.reference.poses(phases))
        self.bodies = self.world.states()

    def step(self, actions: Array, wrenches: Array | None = None) -> Step:
        """One control step with actions (E, 42): corrections of the reference joints as rotation vectors."""
        correction = from_rotvec((actions * ACTION_SCALE).reshape(-1, 1, JOINTS, 3))
        substeps = (1 + np.arange(SUBSTEPS)) * TIME_STEP / self.reference.duration
        joints, velocities = self.reference.joints(self.phases[:, None] + substeps)
        self.bodies = self.world.step(multiply(joints, correction), velocities, wrenches)
        self.phases = self.phases + self._increment
        self._ages += 1
        target = self.reference.bodies(self.phases)
        fallen = self.fallen(target)
        drift = np.linalg.norm(self.bodies.positions[:, 0, :2] - target.positions[:, 0, :2], axis=-1)
        terminated = fallen | (drift > self.config.max_drift)
        truncated = ~terminated & (self._ages >= self.config.episode)
        if not self.reference.cyclic:
            truncated |= ~terminated & (self.phases >= 1.0)
        terms = rewards(self.bodies, target, self.reward)
        return Step(self.observe(), np.where(terminated[:, None], 0.0, terms), terminated, truncated)

    def fallen(self, target: BodyStates | None = None) -> NDArray[np.bool_]:
        """(E,) whether the pelvis is too low, too high or too far turned for its reference."""
        ref = self.reference.bodies(self.phases) if target is None else target
        height = np.abs(self.bodies.positions[:, 0, 2] - ref.positions[:, 0, 2])
        turn = np.linalg.norm(
            to_rotvec(multiply(conjugate(ref.rotations[:, 0]), self.bodies.rotations[:, 0])), axis=-1
        )
        blown = ~np.isfinite(self.bodies.positions).all(axis=(1, 2))
        fell = (height > self.config.max_height_error) | (turn > self.config.max_rotation_error)
        return np.asarray(fell | blown)

    def observe(self) -> Array:
        """(E, OBSERVATIONS) in the figure's own heading: what it is doing and how far from what is next."""
        b = self.bodies
        size = len(self.phases)
        ahead = self.phases + self._increment
        target = self.reference.bodies(ahead)
        forward = rotate(b.rotations[:, 0], np.broadcast_to([1.0, 0.0, 0.0], (size, 3)))
        level = conjugate(from_axis_angle("Z", np.arctan2(forward[:, 1], forward[:, 0])))[:, None]
        rotations = multiply(level, b.rotations)
        offsets = rotate(level, b.positions[:, 1:] - b.positions[:, :1])
        wanted = np.concatenate(
            [
                to_rotvec(multiply(conjugate(b.rotations[:, :1]), target.rotations[:, :1])),
                to_rotvec(multiply(conjugate(b.joints), target.joints)),
            ],
            axis=1,
        )
        drift = np.clip(rotate(level[:, 0], target.positions[:, 0] - b.positions[:, 0])[:, :2], -1.0, 1.0)
        turn = 2.0 * np.pi * self.phases
        parts = [
            np.stack([np.sin(turn), np.cos(turn), b.positions[:, 0, 2]], axis=-1),
            to_six(rotations),
            offsets,
            rotate(level, b.linear),
            rotate(level, b.angular),
            wanted,
            drift,
        ]
        return np.concatenate([part.reshape(size, -1) for part in parts], axis=1)
