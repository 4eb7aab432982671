"""The world on pybullet: one physics client per humanoid, stable PD at 240 Hz."""

from __future__ import annotations

import math
import tempfile
import weakref
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.retarget.formats.urdf import humanoid_urdf
from kinemimic.retarget.humanoid.body import BODIES, BODY_CENTERS, FEET
from kinemimic.train.sim.pybullet_client import (
    FROM_BULLET,
    QUAT_FROM_BULLET,
    QUAT_TO_BULLET,
    TO_BULLET,
    bullet,
)
from kinemimic.train.sim.pybullet_humanoid import (
    JOINT_LINKS,
    LIMITS,
    LINKS,
    build_humanoid,
    control,
    nominal_weights,
    vary_humanoid,
)
from kinemimic.train.sim.pybullet_obstacles import build, start
from kinemimic.train.sim.world import (
    FRICTION,
    MAX_PARTS,
    MAX_SPEED,
    MAX_TURN,
    TIME_STEP,
    BodyStates,
    Obstacle,
    Poses,
    check_variation,
)


def _disconnect(clients: list[int]) -> None:
    for client in clients:
        bullet.disconnect(physicsClientId=client)
    clients.clear()


def _window(array: Array) -> Array:
    """A read-only view."""
    view = array.view()
    view.flags.writeable = False
    return view


class BulletWorld:
    """`World` on pybullet. measure_torques: read the joint sensors in every substep (slower)."""

    engine = "pybullet"

    def __init__(self, size: int, *, measure_torques: bool = False) -> None:
        self.size = size
        self._measure = measure_torques
        self._peaks = np.zeros((size, len(JOINT_LINKS)))
        with tempfile.TemporaryDirectory() as folder:
            urdf = Path(folder) / "humanoid.urdf"
            urdf.write_text(humanoid_urdf("spherical", y_up=True))
            built = [build_humanoid(urdf, measure=measure_torques) for _ in range(size)]
        self._clients = [client for client, _ in built]
        # A client keeps its memory until it is disconnected, even if nobody closes the world.
        self._end = weakref.finalize(self, _disconnect, self._clients)
        self._end.atexit = False
        self._humanoid = built[0][1]  # in every client the same
        self._nominal = nominal_weights(self._clients[0], self._humanoid)
        self._wanted = [(FRICTION, 1.0)] * size
        self._varied = self._wanted.copy()
        for client in self._clients:
            vary_humanoid(client, self._humanoid, self._nominal, *self._wanted[0])
        self._obstacles: list[list[tuple[int, Obstacle]]] = [[] for _ in range(size)]
        self._exploded = np.zeros(size, dtype=np.bool_)
        self._frozen = np.zeros(size, dtype=np.bool_)
        self._parts = [1] * size
        bodies = (size, len(BODIES))
        self._buffers = BodyStates(*(np.zeros((*bodies, width)) for width in (3, 4, 3, 3)))
        self._states = BodyStates(*(_window(array) for array in vars(self._buffers).values()))
        self._read()

    def vary(self, indices: NDArray[np.intp], friction: Array, mass: Array) -> None:
        check_variation(indices, friction, mass)
        for index, coefficient, factor in zip(indices, friction.tolist(), mass.tolist(), strict=True):
            self._wanted[index] = coefficient, factor

    def reset(self, indices: NDArray[np.intp], poses: Poses) -> None:
        root = poses.root[:, TO_BULLET].tolist()
        rotation = poses.root_rotation[:, QUAT_TO_BULLET].tolist()
        linear = poses.root_linear[:, TO_BULLET].tolist()
        angular = poses.root_angular[:, TO_BULLET].tolist()
        joints = poses.joints[..., QUAT_TO_BULLET].tolist()
        velocities = poses.joint_velocities[..., TO_BULLET].tolist()
        for row, index in enumerate(indices):
            client = self._clients[index]
            if self._varied[index] != self._wanted[index]:
                vary_humanoid(client, self._humanoid, self._nominal, *self._wanted[index])
                self._varied[index] = self._wanted[index]
            self._forget_contacts(index, client)
            bullet.resetBasePositionAndOrientation(
                self._humanoid, root[row], rotation[row], physicsClientId=client
            )
            bullet.resetBaseVelocity(self._humanoid, linear[row], angular[row], physicsClientId=client)
            bullet.resetJointStatesMultiDof(
                self._humanoid, JOINT_LINKS, joints[row], velocities[row], physicsClientId=client
            )
            for body, item in self._obstacles[index]:
                start(client, body, item)
        self._peaks[indices] = 0.0
        self._exploded[indices] = False
        self._frozen[indices] = False
        self._read()

    def _forget_contacts(self, index: int, client: int) -> None:
        """Clear Bullet's cached contacts by detecting collisions with all bodies far apart: it would
        warm-start the next step with their forces.

        With several obstacles it may find contacts in another order afterwards, which changes the last
        digits.
        """
        for body in (self._humanoid, *(body for body, _ in self._obstacles[index])):
            bullet.resetBasePositionAndOrientation(
                body, [0, 1000.0 * (body + 1), 0], [0, 0, 0, 1], physicsClientId=client
            )
        bullet.performCollisionDetection(physicsClientId=client)

    def freeze(self, indices: NDArray[np.intp]) -> None:
        self._frozen[indices] = True

    def step(self, targets: Array, target_velocities: Array, wrenches: Array | None = None) -> BodyStates:
        positions = targets[..., QUAT_TO_BULLET].tolist()
        velocities = target_velocities[..., TO_BULLET].tolist()
        if self._measure:
            self._peaks[~self._frozen] = 0.0
        for index, client in enumerate(self._clients):
            if self._exploded[index] or self._frozen[index]:
                continue
            wrench = None if wrenches is None else wrenches[index]
            for target, velocity in zip(positions[index], velocities[index], strict=True):
                self._substep(index, client, target, velocity, wrench)
        self._read()
        return self._states

    def _substep(
        self, index: int, client: int, target: list[Any], velocity: list[Any], wrench: Array | None
    ) -> None:
        parts = self._parts[index] = self._division(client)
        if parts > 1:
            bullet.setPhysicsEngineParameter(fixedTimeStep=TIME_STEP / parts, physicsClientId=client)
        for _ in range(parts):
            control(client, self._humanoid, target, velocity, LIMITS)
            # Bullet forgets external forces after every step.
            if wrench is not None:
                self._push(client, wrench)
            bullet.stepSimulation(physicsClientId=client)
            if self._measure:
                np.maximum(self._peaks[index], self._torques(client), out=self._peaks[index])
        if parts > 1:
            bullet.setPhysicsEngineParameter(fixedTimeStep=TIME_STEP, physicsClientId=client)

    def _division(self, client: int) -> int:
        """Number of parts of the next step."""
        states = bullet.getJointStatesMultiDof(self._humanoid, JOINT_LINKS, physicsClientId=client)
        turn = TIME_STEP * max(math.hypot(*state[1]) for state in states)
        # Written so that NaN is not divided.
        return min(max(math.ceil(turn / MAX_TURN), 1), MAX_PARTS) if turn > MAX_TURN else 1

    def _push(self, client: int, wrench: Array) -> None:
        for body in np.flatnonzero(np.any(wrench != 0.0, axis=-1)).tolist():
            force, torque = wrench[body, :3][TO_BULLET].tolist(), wrench[body, 3:][TO_BULLET].tolist()
            center = bullet.getLinkState(self._humanoid, body, physicsClientId=client)[0]
            bullet.applyExternalForce(
                self._humanoid, body, force, center, bullet.WORLD_FRAME, physicsClientId=client
            )
            bullet.applyExternalTorque(
                self._humanoid, body, torque, bullet.WORLD_FRAME, physicsClientId=client
            )

    def _torques(self, client: int) -> Array:
        """Largest component of each joint's torque, N·m, from the reaction in its sensor.

        The sensor reports the wrench about the child's centre of mass, not about the joint.
        """
        states = bullet.getJointStatesMultiDof(self._humanoid, JOINT_LINKS, physicsClientId=client)
        wrench = np.array([state[2] for state in states])[:, [*FROM_BULLET, *(3 + k for k in FROM_BULLET)]]
        torque = wrench[:, 3:] + np.cross(BODY_CENTERS[1:], wrench[:, :3])
        return np.asarray(np.abs(torque).max(axis=-1))

    def _read(self) -> None:
        """Update the states, except of exploded humanoids, which keep their last one."""
        rows = [
            bullet.getLinkStates(
                self._humanoid,
                LINKS,
                computeLinkVelocity=1,
                computeForwardKinematics=1,
                physicsClientId=client,
            )
            for client in self._clients
        ]
        flat = np.array([[(*s[0], *s[1], *s[6], *s[7]) for s in row] for row in rows])
        speed = np.linalg.norm(flat[..., 7:10], axis=-1).max(axis=-1)
        sound = np.isfinite(flat).all(axis=(1, 2)) & (speed < MAX_SPEED)
        self._exploded |= ~sound
        kept = ~self._exploded
        found = self._buffers
        found.positions[kept] = flat[kept, :, 0:3][..., FROM_BULLET]
        found.rotations[kept] = flat[kept, :, 3:7][..., QUAT_FROM_BULLET]
        found.linear[kept] = flat[kept, :, 7:10][..., FROM_BULLET]
        found.angular[kept] = flat[kept, :, 10:13][..., FROM_BULLET]

    def states(self) -> BodyStates:
        return self._states

    def exploded(self) -> NDArray[np.bool_]:
        return self._exploded.copy()

    def contacts(self) -> NDArray[np.bool_]:
        return np.array(
            [
                [
                    not exploded
                    and any(
                        point[8] < 1e-3
                        for point in bullet.getContactPoints(
                            bodyA=self._humanoid, linkIndexA=foot, physicsClientId=client
                        )
                    )
                    for foot in FEET
                ]
                for client, exploded in zip(self._clients, self._exploded, strict=True)
            ]
        )

    def contact_forces(self) -> Array:
        forces = np.zeros((self.size, len(BODIES), 3))
        for index, client in enumerate(self._clients):
            if self._exploded[index]:
                continue
            for point in bullet.getContactPoints(bodyA=self._humanoid, physicsClientId=client):
                normal, first, second = (np.array(point[k])[FROM_BULLET] for k in (7, 11, 13))
                force = normal * point[9] + first * point[10] + second * point[12]
                # pybullet divides the impulse by the undivided step.
                forces[index, point[3]] += force * self._parts[index]
        return forces

    def peak_torques(self) -> Array:
        if not self._measure:
            raise RuntimeError("this world was created without measure_torques")
        return _window(self._peaks)

    def place(self, index: int, obstacles: Sequence[Obstacle]) -> None:
        client = self._clients[index]
        for body, _ in self._obstacles[index]:
            bullet.removeBody(body, physicsClientId=client)
        self._obstacles[index] = [(build(client, item), item) for item in obstacles]

    def placed(self, index: int) -> Sequence[Obstacle]:
        return [item for _, item in self._obstacles[index]]

    def obstacles(self, index: int) -> Array:
        client = self._clients[index]
        rows = []
        for body, _ in self._obstacles[index]:
            position, rotation = bullet.getBasePositionAndOrientation(body, physicsClientId=client)
            linear, angular = bullet.getBaseVelocity(body, physicsClientId=client)
            vectors = np.array([position, linear, angular])[:, FROM_BULLET]
            rows.append(np.concatenate([vectors[0], np.array(rotation)[QUAT_FROM_BULLET], *vectors[1:]]))
        return np.array(rows, dtype=np.float64).reshape(-1, 13)

    def close(self) -> None:
        self._end()
