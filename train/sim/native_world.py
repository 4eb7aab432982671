"""The world of the native engine (`train/native/`): all humanoids in one call, on several threads."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import kinemimic_native
import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.gravity import GRAVITY
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.retarget.formats.urdf import SMALL_INERTIA, SMALL_MASS
from kinemimic.retarget.humanoid.body import (
    BODIES,
    BODY_CENTERS,
    BODY_MASSES,
    BODY_PARENTS,
    FEET,
    Body,
    node_offsets,
)
from kinemimic.train.sim.world import (
    CONTACT_ERP,
    FRICTION,
    MAX_PARTS,
    MAX_SPEED,
    MAX_TURN,
    SOLVER_ITERATIONS,
    SPEED_LIMIT,
    TIME_STEP,
    BodyStates,
    Obstacle,
    Poses,
    check_variation,
)

# Constants of the world, as arguments of `kinemimic_native.Batch`.
SETTINGS: dict[str, Any] = {
    "time_step": TIME_STEP,
    "gravity": GRAVITY,
    "friction": FRICTION,
    "iterations": SOLVER_ITERATIONS,
    "contact_erp": CONTACT_ERP,
    "fastest": MAX_SPEED,
    "free_speed": SPEED_LIMIT,
    "largest_turn": MAX_TURN,
    "most_parts": MAX_PARTS,
}
_SHAPES = {"box": 0, "sphere": 1, "ellipsoid": 2}
_OBSTACLE_SHAPES = {"box": 0, "sphere": 1, "cylinder": 2}


def _control_inertia(body: Body) -> tuple[float, float, float]:
    """Moments of inertia that pybullet's stable PD assumes for a body: those of its collision shape.

    They only affect the controller's prediction of the end of the step. A capsule, which approximates an
    ellipsoid, is a cylinder and two half-spheres of one density.
    """
    if body.shape != "ellipsoid":
        return body.inertia
    radius, height = 0.5 * body.size[0], body.size[2] - body.size[0]
    volumes = np.array([math.pi * radius**2 * height, 4.0 / 3.0 * math.pi * radius**3])
    cylinder, caps = body.mass * volumes / volumes.sum()
    across = cylinder * (radius**2 / 4 + height**2 / 12) + caps * (
        0.4 * radius**2 + 0.375 * radius * height + 0.5 * height**2
    )
    along = (0.5 * cylinder + 0.4 * caps) * radius**2
    return across, across, along


def description() -> dict[str, Any]:
    """The body of `retarget/humanoid/body.py` as the arguments of `kinemimic_native.Batch`."""
    offsets = node_offsets()
    masses = BODY_MASSES.copy()
    inertias = np.array([body.inertia for body in BODIES])
    # pybullet's humanoid has a base inside its pelvis.
    masses[0] += SMALL_MASS
    inertias[0] += SMALL_INERTIA
    return {
        "parents": np.array(BODY_PARENTS, dtype=np.int32),
        "shapes": np.array([_SHAPES[body.shape] for body in BODIES], dtype=np.int32),
        "sizes": np.array([body.size for body in BODIES]),
        "masses": masses,
        "inertias": inertias,
        "control_inertias": np.array([_control_inertia(body) for body in BODIES]),
        "centers": BODY_CENTERS,
        "joints": np.array([offsets[NODE_INDEX[body.node]] for body in BODIES]),
        "stiffness": np.array([body.stiffness for body in BODIES]),
        "damping": np.array([body.damping for body in BODIES]),
        "torque_limits": np.array([body.torque_limit for body in BODIES]),
    }


class NativeWorld:
    """`World` on the C++ extension; `threads` share the humanoids. Several threads do not survive a fork."""

    engine = "native"

    def __init__(self, size: int, *, threads: int = 1) -> None:
        self.size = size
        self._batch = kinemimic_native.Batch(
            size=size,
            **description(),
            **SETTINGS,
            threads=threads,
        )
        batch = self._batch
        self._placed: list[tuple[Obstacle, ...]] = [()] * size
        self._states = BodyStates(batch.positions, batch.rotations, batch.linear, batch.angular)

    def vary(self, indices: NDArray[np.intp], friction: Array, mass: Array) -> None:
        check_variation(indices, friction, mass)
        self._batch.vary(indices, friction, mass)

    def reset(self, indices: NDArray[np.intp], poses: Poses) -> None:
        self._batch.reset(
            indices, poses.root, poses.root_rotation, poses.root_linear, poses.root_angular, poses.joints,
            poses.joint_velocities,
        )  # fmt: skip

    def freeze(self, indices: NDArray[np.intp]) -> None:
        self._batch.freeze(indices)

    def step(self, targets: Array, target_velocities: Array, wrenches: Array | None = None) -> BodyStates:
        self._batch.step(targets, target_velocities, wrenches)
        return self._states

    def states(self) -> BodyStates:
        return self._states

    def exploded(self) -> NDArray[np.bool_]:
        return self._batch.exploded.copy()

    def contacts(self) -> NDArray[np.bool_]:
        return self._batch.touching()[:, FEET]

    def contact_forces(self) -> Array:
        return self._batch.contact_forces()

    def peak_torques(self) -> Array:
        return self._batch.peaks

    def place(self, index: int, obstacles: Sequence[Obstacle]) -> None:
        self._batch.place(
            index,
            shapes=np.array([_OBSTACLE_SHAPES[item.shape] for item in obstacles], dtype=np.int32),
            sizes=np.array([item.size for item in obstacles]).reshape(-1, 3),
            masses=np.array([item.mass for item in obstacles]),
            positions=np.array([item.position for item in obstacles]).reshape(-1, 3),
            rotations=np.array([item.rotation for item in obstacles]).reshape(-1, 4),
            velocities=np.array([item.velocity for item in obstacles]).reshape(-1, 3),
            spins=np.array([item.spin for item in obstacles]).reshape(-1, 3),
        )
        self._placed[index] = tuple(obstacles)

    def placed(self, index: int) -> Sequence[Obstacle]:
        return self._placed[index]

    def obstacles(self, index: int) -> Array:
        return self._batch.obstacles(index)

    def close(self) -> None:
        """Does nothing: Python owns the memory."""
