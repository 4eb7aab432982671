"""The world that every engine offers: a batch of humanoids, stepped together, their bodies as arrays."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Protocol, get_args

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import conjugate, multiply
from kinemimic.retarget.humanoid.body import BODY_PARENTS

CONTROL_RATE = 30  # Hz: the policy's
SUBSTEPS = 8  # physics steps in a control step: 240 Hz
TIME_STEP = 1.0 / (CONTROL_RATE * SUBSTEPS)
GRAVITY = 9.81
FRICTION = 0.9
SOLVER_ITERATIONS = 10
# Where joints turn fast (a hand that hits the ground reaches 70 rad/s in one step), a step is divided: whole,
# its explicit integration would make energy. Bullet's own remedy, to cut off speeds, hurls a figure away.
MAX_TURN = 0.1  # rad that a joint may turn in one part of a step
MAX_PARTS = 8
SPEED_LIMIT = 1000.0  # rad/s, m/s: Bullet's own limit of joint and root speeds, set where it never acts
MAX_SPEED = 100.0  # m/s: no part of a body that obeys its joints comes near; what goes faster has exploded
# Stable PD, at these gains, takes all of a joint's speed in one step from the moments that it reckons with:
# capsules', larger than the ellipsoids' own. What is much lighter is thrown back further than it came: in 40
# postures joints came to rest at 0.70, and shook without end at 0.68.
MIN_MASS = 0.7  # of the nominal mass
JOINT_PARENTS: NDArray[np.intp] = np.array(BODY_PARENTS[1:])


@dataclass(frozen=True)
class BodyStates:
    """The 15 bodies of E figures in the world: Z up, metres, seconds, radians.

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


@dataclass(frozen=True)
class Poses:
    """What sets E figures: root (E, 3), root rotation (E, 4) and velocities (E, 3) in the world,
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
    """Something in a figure's way: it stands there (mass 0), or is thrown.

    size: (x, y, z) outer dimensions, metres; a sphere's diameter is x, a cylinder's too, and z its length.
    mass: kg; position: (x, y, z) of its centre, rotation: (x, y, z, w), velocity: m/s, spin: rad/s, all when
    it is placed and after every reset.
    ValueError for another shape, a size that is not above 0, a negative mass, and what is not finite.
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
    """ValueError unless friction and mass are what `World.vary` takes for these indices."""
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

    What `states`, `step` and `peak_torques` return are windows on the engine's own memory: read-only, and
    valid until the next `reset` or `step`. Whoever keeps them copies them. One call at a time.
    """

    size: int
    engine: str

    def vary(self, indices: NDArray[np.intp], friction: Array, mass: Array) -> None:
        """Make the figures of `indices` (N,) others from their next reset on, until they are varied again.

        friction: (N,) coefficient between their bodies and everything they touch, at least 0; FRICTION unless
        varied. mass: (N,) what the mass and the inertia of every body are multiplied by, at least LIGHTEST;
        1 unless varied. Neither tells the stable PD, which goes on to reckon with the nominal masses, as the
        motors of a body do that has put on a load. ValueError for other numbers.
        """

    def reset(self, indices: NDArray[np.intp], poses: Poses) -> None:
        """Put the figures of `indices` (N,) into N poses; what happened to them before is forgotten."""

    def step(self, targets: Array, target_velocities: Array, wrenches: Array | None = None) -> BodyStates:
        """One control step of SUBSTEPS physics steps with stable PD.

        targets: (E, SUBSTEPS, 14, 4) joint rotations; target_velocities: (E, SUBSTEPS, 14, 3) rad/s in the
        child's frame; wrenches: (E, 15, 6) force N and torque N·m on each body for the whole control step,
        in the world, at its centre of mass.
        """

    def states(self) -> BodyStates:
        """All bodies now."""

    def exploded(self) -> NDArray[np.bool_]:
        """(E,) whose state was no longer that of a body: infinite, NaN or faster than FASTEST.

        Such a figure stays where it was last sound, with its last sound velocities, and touches nothing until
        it is reset. A reset to a pose that is not sound itself makes one too.
        """

    def contacts(self) -> NDArray[np.bool_]:
        """(E, 2): left, right foot touches something."""

    def contact_forces(self) -> Array:
        """(E, 15, 3) force of all contacts on each body in the last physics step, N, in the world."""

    def peak_torques(self) -> Array:
        """(E, 14) largest component of each joint's torque in the last control step, N·m; if asked for."""

    def place(self, index: int, obstacles: Sequence[Obstacle]) -> None:
        """Replace all obstacles of a figure, also in mid-flight; they are at their start now and after each
        of its resets."""

    def obstacles(self, index: int) -> Array:
        """(K, 13) position, rotation, velocity and angular velocity of a figure's obstacles now."""

    def close(self) -> None:
        """Free the engine."""
