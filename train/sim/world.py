"""The interface of the engines: a batch of humanoids, stepped together, their bodies as arrays."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Literal, Protocol, get_args

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import conjugate, multiply
from kinemimic.retarget.humanoid.body import BODY_PARENTS

CONTROL_RATE = 30  # Hz: the policy's
SUBSTEPS = 8  # physics steps in a control step: 240 Hz
TIME_STEP = 1.0 / (CONTROL_RATE * SUBSTEPS)
FRICTION = 0.9
SOLVER_ITERATIONS = 10
CONTACT_ERP = 0.08  # share of a penetration that one step corrects: pybullet's own
# Where joints turn fast (a hand that hits the ground reaches 70 rad/s in one step), a step is divided:
# explicit integration of the whole step would add energy. Bullet's own remedy, clipping speeds, flings a
# humanoid away.
MAX_TURN = 0.1  # rad that a joint may turn in one part of a step
MAX_PARTS = 8
SPEED_LIMIT = 1000.0  # rad/s, m/s: Bullet's own limit of joint and root speeds, never reached
MAX_SPEED = 100.0  # m/s: no body of an intact humanoid comes near; faster means exploded
# At these gains, stable PD removes all of a joint's speed in one step for the moments of inertia that it
# assumes: those of capsules, larger than the ellipsoids' own. A much lighter body overshoots: in 40 postures
# joints came to rest at 0.70, and oscillated forever at 0.68.
MIN_MASS = 0.7  # of the nominal mass
JOINT_PARENTS: NDArray[np.intp] = np.array(BODY_PARENTS[1:])


@dataclass(frozen=True)
class BodyStates:
    """The 15 bodies of E humanoids in the world: Z up, metres, seconds, radians.

    positions: (E, 15, 3) of the centres of mass; rotations: (E, 15, 4);
    linear, angular: (E, 15, 3) velocities.
    """

    positions: Array
    rotations: Array
    linear: Array
    angular: Array

    @property
    def joints(self) -> Array:
        """Rotations (E, 14, 4) of the joints, child to parent."""
        return multiply(conjugate(self.rotations[:, JOINT_PARENTS]), self.rotations[:, 1:])

    def with_rows(self, rows: NDArray[np.intp], other: BodyStates) -> BodyStates:
        """A copy in which these humanoids (N,) are those of `other`."""
        copies = {field.name: np.array(getattr(self, field.name)) for field in fields(self)}
        for name, values in copies.items():
            values[rows] = getattr(other, name)[rows]
        return BodyStates(**copies)


@dataclass(frozen=True)
class Poses:
    """Initial states of E humanoids: root (E, 3), root rotation (E, 4) and velocities (E, 3) in the world,
    joint rotations (E, 14, 4) and joint velocities (E, 14, 3) in the child's frame."""

    root: Array
    root_rotation: Array
    root_linear: Array
    root_angular: Array
    joints: Array
    joint_velocities: Array


Shape = Literal["box", "sphere", "cylinder"]


@dataclass(frozen=True)
class Obstacle:
    """An obstacle: static (mass 0), movable or thrown.

    size: (x, y, z) outer dimensions, metres; x is the diameter of a sphere or cylinder, z a cylinder's
    length. mass: kg; position: (x, y, z) of its centre, rotation: (x, y, z, w), velocity: m/s, spin: rad/s,
    all when placed and after every reset. ValueError for another shape, a size of 0 or less, a negative mass,
    and numbers that are not finite.
    """

    shape: Shape
    size: tuple[float, float, float]
    position: tuple[float, float, float]
    rotation: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)
    mass: float = 0.0
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    spin: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        numbers = (*self.size, *self.position, *self.rotation, self.mass, *self.velocity, *self.spin)
        finite = all(map(math.isfinite, numbers))
        if self.shape not in get_args(Shape) or not finite or min(self.size) <= 0 or self.mass < 0:
            raise ValueError(
                f"obstacle: expected one of {', '.join(get_args(Shape))} with finite numbers, a size above 0 "
                f"and no negative mass, found {self}"
            )


def check_variation(indices: NDArray[np.intp], friction: Array, mass: Array) -> None:
    """ValueError unless friction and mass are valid for `World.vary`."""
    for name, values, sound, wanted in (
        ("friction", friction, friction >= 0, "at least 0"),
        ("mass", mass, mass >= MIN_MASS, f"at least {MIN_MASS}"),
    ):
        if values.shape != np.shape(indices):
            raise ValueError(f"{name}: expected the shape {np.shape(indices)}, found {values.shape}")
        if wrong := values[~(np.isfinite(values) & sound)].tolist():
            raise ValueError(f"{name}: expected finite numbers {wanted}, found {wrong[0]}")


class World(Protocol):
    """A batch of `size` humanoids on level ground, each alone in its world.

    `states`, `step` and `peak_torques` return read-only views of the engine's memory, valid until the next
    `reset` or `step`; copy them to keep them. Not thread-safe.
    """

    size: int
    engine: str

    def vary(self, indices: NDArray[np.intp], friction: Array, mass: Array) -> None:
        """Set friction and mass of the humanoids `indices` (N,) from their next reset on.

        friction: (N,) coefficient between their bodies and everything they touch, at least 0, FRICTION by
        default. mass: (N,) factor for the mass and inertia of every body, at least MIN_MASS, 1 by default.
        The stable PD keeps assuming the nominal masses, as if the body carried a load. ValueError for other
        numbers.
        """

    def reset(self, indices: NDArray[np.intp], poses: Poses) -> None:
        """Reset the humanoids `indices` (N,) to N poses, and clear their contacts and torques."""

    def freeze(self, indices: NDArray[np.intp]) -> None:
        """Leave the humanoids `indices` (N,) and their obstacles as they are until their next reset: steps
        simulate the others only."""

    def step(self, targets: Array, target_velocities: Array, wrenches: Array | None = None) -> BodyStates:
        """One control step of SUBSTEPS physics steps with stable PD.

        targets: (E, SUBSTEPS, 14, 4) joint rotations; target_velocities: (E, SUBSTEPS, 14, 3) rad/s in the
        child's frame; wrenches: (E, 15, 6) force N and torque N·m on each body for the whole control step,
        in the world, at its centre of mass.
        """

    def states(self) -> BodyStates:
        """All bodies now."""

    def exploded(self) -> NDArray[np.bool_]:
        """(E,) whether the state became invalid: infinite, NaN or faster than MAX_SPEED.

        Such a humanoid keeps its last valid state and touches nothing until its reset. A reset to an invalid
        pose counts too.
        """

    def contacts(self) -> NDArray[np.bool_]:
        """(E, 2) whether the left and right foot touch something."""

    def contact_forces(self) -> Array:
        """(E, 15, 3) force of all contacts on each body in the last physics step, N, in the world."""

    def peak_torques(self) -> Array:
        """(E, 14) largest component of each joint's torque in the last control step, N·m, if measured."""

    def place(self, index: int, obstacles: Sequence[Obstacle]) -> None:
        """Replace all obstacles of a humanoid, also during an episode; they are in their initial state now
        and after each reset."""

    def placed(self, index: int) -> Sequence[Obstacle]:
        """A humanoid's obstacles, as they were placed."""

    def obstacles(self, index: int) -> Array:
        """(K, 13) position, rotation, velocity and angular velocity of a humanoid's obstacles now."""

    def close(self) -> None:
        """Free the engine."""
