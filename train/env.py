"""The imitation task on a batch of figures: observation, action, reward, end of an episode."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.rotations import from_rotvec, multiplier, to_six
from kinemimic.retarget.body import BODIES
from kinemimic.train.config import EnvConfig
from kinemimic.train.reference import Reference
from kinemimic.train.reward import pose_turns, rewards
from kinemimic.train.stopwatch import Stopwatch
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
# What a moment between two control steps is put down to (`stopwatch.py`).
SIMULATION = "simulation"
TASK = "observation and reward"
OBSERVATIONS = 2 + 1 + 15 * 6 + 14 * 3 + 15 * 3 + 15 * 3 + 15 * 3 + 2


@dataclass(frozen=True)
class Step:
    """Result of a control step for E figures.

    observations: (E, OBSERVATIONS) after the step, before any reset; terms: (E, K) reward terms;
    terminated: (E,) fell, lost the reference or exploded; truncated: (E,) time is up (not a fall);
    exploded: (E,) the engine lost the figure's state and holds its last sound one.
    """

    observations: Array
    terms: Array
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]
    exploded: NDArray[np.bool_]


class ImitationBatch:
    """E figures that imitate one reference. Time of each is its phase in the reference, not wrapped.

    bodies: simulated, in the world's own arrays: valid until the next step or reset;
    target, ahead: the reference now and a control step later; watch: where the time goes.
    """

    def __init__(self, world: World, reference: Reference, config: EnvConfig) -> None:
        self.world = world
        self.reference = reference
        self.config = config
        self.reward = config.reward  # may be changed between steps
        self.watch = Stopwatch()
        self.phases: Array = np.zeros(world.size)
        self._ages = np.zeros(world.size, dtype=np.int64)
        self._increment = 1.0 / (CONTROL_RATE * reference.duration)
        self._substeps: Array = np.arange(1.0, SUBSTEPS + 1) * TIME_STEP / reference.duration
        self.bodies: BodyStates = world.states()
        self._face(reference.bodies(self.phases))

    def _face(self, target: BodyStates) -> None:
        """Set the figures, as they are now, against their target and what comes after it."""
        self.target = target
        self._exploded = self.world.exploded()
        self.ahead = self.reference.bodies(self.phases + self._increment)
        self._turns, self._turns_ahead = pose_turns(self.bodies, self.target, self.ahead)

    def reset(self, indices: NDArray[np.intp], phases: Array) -> None:
        """Put figures (N,) on the reference at phases (N,)."""
        self.phases[indices] = phases
        self._ages[indices] = 0
        poses = self.reference.poses(phases)
        self.watch.lap(TASK)
        self.world.reset(indices, poses)
        self.bodies = self.world.states()
        self.watch.lap(SIMULATION)
        self._face(self.reference.bodies(self.phases))

    def step(self, actions: Array, wrenches: Array | None = None) -> Step:
        """One control step with actions (E, 42): corrections of the reference joints as rotation vectors."""
        correction = multiplier(from_rotvec((actions * ACTION_SCALE).reshape(-1, JOINTS, 3)))
        joints, velocities = self.reference.joints(self.phases[:, None] + self._substeps)
        # One correction for the targets of all substeps: products of 8 x 4 and 4 x 4 matrices.
        targets = np.empty(joints.shape)
        np.matmul(joints.swapaxes(1, 2), correction, out=targets.swapaxes(1, 2))
        self.watch.lap(TASK)
        self.bodies = self.world.step(targets, velocities, wrenches)
        self.watch.lap(SIMULATION)
        self.phases = self.phases + self._increment
        self._ages += 1
        self._face(self.ahead)
        way = self.bodies.positions[:, 0] - self.target.positions[:, 0]
        terminated = self.fallen() | (np.hypot(way[:, 0], way[:, 1]) > self.config.max_drift)
        truncated = ~terminated & (self._ages >= self.config.episode)
        if not self.reference.cyclic:
            truncated |= ~terminated & (self.phases >= 1.0)
        terms = np.where(terminated[:, None], 0.0, self.terms())
        return Step(self.observe(), terms, terminated, truncated, self._exploded)

    def terms(self) -> Array:
        """Reward terms (E, K) of the figures as they are, fallen or not."""
        return rewards(self.bodies, self.target, self._turns, self.reward)

    def fallen(self) -> NDArray[np.bool_]:
        """(E,) exploded, or with the pelvis too low, too high or too far turned for its reference."""
        height = np.abs(self.bodies.positions[:, 0, 2] - self.target.positions[:, 0, 2])
        turn = np.einsum("ei,ei->e", self._turns[:, 0], self._turns[:, 0])
        fell = (height > self.config.max_height_error) | (turn > self.config.max_rotation_error**2)
        return np.asarray(fell | self._exploded)

    def observe(self) -> Array:
        """(E, OBSERVATIONS) in the figure's own heading: what it is doing and how far from what is next."""
        b = self.bodies
        size = len(self.phases)
        six = to_six(b.rotations)
        vectors = np.concatenate(
            [
                six.reshape(size, -1, 3),
                b.positions[:, 1:] - b.positions[:, :1],
                b.linear,
                b.angular,
                self.ahead.positions[:, :1] - b.positions[:, :1],
            ],
            axis=1,
        )
        # The pelvis faces along its x-axis.
        vectors = _levelled(vectors, np.arctan2(six[:, 0, 1], six[:, 0, 0]))
        turn = 2.0 * np.pi * self.phases
        parts = [
            np.array([np.sin(turn), np.cos(turn), b.positions[:, 0, 2]]).T,
            vectors[:, :-1].reshape(size, -1),
            self._turns_ahead.reshape(size, -1),
            np.minimum(np.maximum(vectors[:, -1, :2], -1.0), 1.0),
        ]
        return np.concatenate(parts, axis=1)


def _levelled(vectors: Array, heading: Array) -> Array:
    """Vectors (E, N, 3) of the world as seen along a heading (E,), radians about the vertical."""
    cosine, sine = np.cos(heading)[:, None], np.sin(heading)[:, None]
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    turned = np.empty(vectors.shape)
    turned[..., 0] = cosine * x + sine * y
    turned[..., 1] = cosine * y - sine * x
    turned[..., 2] = z
    return turned
