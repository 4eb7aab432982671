"""The world on the pybullet wheel: one physics client per figure, stable PD at 240 Hz.

Inside Bullet the axes are X left, Y up, Z forward (see `retarget/urdf.py`): a cyclic change of components,
done at this file's border and nowhere else.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kinemimic.retarget.body import BODIES, BODY_INDEX
from kinemimic.retarget.urdf import humanoid_urdf
from kinemimic.train.world import FRICTION, GRAVITY, SUBSTEPS, TIME_STEP, BodyStates, Poses

Array = NDArray[np.float64]

_TO_BULLET = [1, 2, 0]
_QUAT_TO_BULLET = [1, 2, 0, 3]
_FROM_BULLET = [2, 0, 1]
_QUAT_FROM_BULLET = [2, 0, 1, 3]
_JOINTS = list(range(1, len(BODIES)))  # link k is BODIES[k]
_LINKS = list(range(len(BODIES)))
_FEET = (BODY_INDEX["foot_left"], BODY_INDEX["foot_right"])
_STIFFNESS = [body.stiffness for body in BODIES[1:]]
_DAMPING = [body.damping for body in BODIES[1:]]
_LIMITS = [[body.torque_limit] * 3 for body in BODIES[1:]]
_CENTERS = np.array([body.center for body in BODIES[1:]])


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep pybullet's build line, printed by its C code on import, off the terminal."""
    sys.stderr.flush()
    saved, null = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 2)
    try:
        yield
    finally:
        os.dup2(saved, 2)
        os.close(saved)
        os.close(null)


with _quiet():
    import pybullet as bullet


class BulletWorld:
    """`World` on pybullet. With `measure_torques`, joint sensors are read in every substep (slower)."""

    def __init__(self, size: int, *, measure_torques: bool = False) -> None:
        self.size = size
        self._measure = measure_torques
        self._peaks = np.zeros((size, len(_JOINTS)))
        self._clients: list[int] = []
        with tempfile.TemporaryDirectory() as folder:
            urdf = Path(folder) / "humanoid.urdf"
            urdf.write_text(humanoid_urdf("spherical", y_up=True))
            for _ in range(size):
                self._clients.append(self._build(urdf))

    def _build(self, urdf: Path) -> int:
        client: int = bullet.connect(bullet.DIRECT)
        if client < 0:
            raise RuntimeError("pybullet gives no more physics clients in this process")
        bullet.setPhysicsEngineParameter(
            fixedTimeStep=TIME_STEP, numSolverIterations=10, numSubSteps=1, physicsClientId=client
        )
        bullet.setGravity(0, -GRAVITY, 0, physicsClientId=client)
        plane = bullet.createCollisionShape(bullet.GEOM_PLANE, planeNormal=[0, 1, 0], physicsClientId=client)
        ground = bullet.createMultiBody(0, plane, physicsClientId=client)
        # Bullet multiplies the frictions of two bodies.
        bullet.changeDynamics(ground, -1, lateralFriction=1.0, physicsClientId=client)
        flags = bullet.URDF_USE_INERTIA_FROM_FILE | bullet.URDF_MAINTAIN_LINK_ORDER
        self._figure: int = bullet.loadURDF(str(urdf), [0, 2, 0], flags=flags, physicsClientId=client)
        for link in (-1, *_LINKS):
            bullet.changeDynamics(
                self._figure, link, lateralFriction=FRICTION, linearDamping=0, angularDamping=0,
                jointDamping=0, activationState=bullet.ACTIVATION_STATE_DISABLE_SLEEPING,
                physicsClientId=client,
            )  # fmt: skip
        for joint in _JOINTS:
            # Both kinds of default motor would hold the joint.
            bullet.setJointMotorControlMultiDof(
                self._figure, joint, bullet.POSITION_CONTROL, targetPosition=[0, 0, 0, 1], positionGain=0,
                velocityGain=0, force=[0, 0, 0], physicsClientId=client,
            )  # fmt: skip
            bullet.setJointMotorControl2(
                self._figure, joint, bullet.POSITION_CONTROL, targetPosition=0, positionGain=0,
                velocityGain=0, force=0, physicsClientId=client,
            )  # fmt: skip
            if self._measure:
                bullet.enableJointForceTorqueSensor(self._figure, joint, True, physicsClientId=client)
        return client

    def reset(self, indices: NDArray[np.intp], poses: Poses) -> None:
        root = poses.root[:, _TO_BULLET].tolist()
        rotation = poses.root_rotation[:, _QUAT_TO_BULLET].tolist()
        linear = poses.root_linear[:, _TO_BULLET].tolist()
        angular = poses.root_angular[:, _TO_BULLET].tolist()
        joints = poses.joints[..., _QUAT_TO_BULLET].tolist()
        velocities = poses.joint_velocities[..., _TO_BULLET].tolist()
        for row, index in enumerate(indices):
            client = self._clients[index]
            bullet.resetBasePositionAndOrientation(
                self._figure, root[row], rotation[row], physicsClientId=client
            )
            bullet.resetBaseVelocity(self._figure, linear[row], angular[row], physicsClientId=client)
            bullet.resetJointStatesMultiDof(
                self._figure, _JOINTS, joints[row], velocities[row], physicsClientId=client
            )
        self._peaks[indices] = 0.0

    def step(self, targets: Array, target_velocities: Array, wrenches: Array | None = None) -> BodyStates:
        positions = targets[..., _QUAT_TO_BULLET].tolist()
        velocities = target_velocities[..., _TO_BULLET].tolist()
        if self._measure:
            self._peaks[:] = 0.0
        for index, client in enumerate(self._clients):
            for substep in range(SUBSTEPS):
                bullet.setJointMotorControlMultiDofArray(
                    self._figure, _JOINTS, bullet.STABLE_PD_CONTROL,
                    targetPositions=positions[index][substep], targetVelocities=velocities[index][substep],
                    forces=_LIMITS, positionGains=_STIFFNESS, velocityGains=_DAMPING, physicsClientId=client,
                )  # fmt: skip
                # Bullet forgets external forces after every step.
                if wrenches is not None:
                    self._push(client, wrenches[index])
                bullet.stepSimulation(physicsClientId=client)
                if self._measure:
                    np.maximum(self._peaks[index], self._torques(client), out=self._peaks[index])
        return self.states()

    def _push(self, client: int, wrench: Array) -> None:
        for body in np.flatnonzero(np.any(wrench != 0.0, axis=-1)).tolist():
            force, torque = wrench[body, :3][_TO_BULLET].tolist(), wrench[body, 3:][_TO_BULLET].tolist()
            center = bullet.getLinkState(self._figure, body, physicsClientId=client)[0]
            bullet.applyExternalForce(
                self._figure, body, force, center, bullet.WORLD_FRAME, physicsClientId=client
            )
            bullet.applyExternalTorque(self._figure, body, torque, bullet.WORLD_FRAME, physicsClientId=client)

    def _torques(self, client: int) -> Array:
        """Largest component of each joint's torque, N·m, from the reaction that its sensor felt.

        The sensor reports the wrench about the child's centre of mass; the joint lies elsewhere.
        """
        states = bullet.getJointStatesMultiDof(self._figure, _JOINTS, physicsClientId=client)
        wrench = np.array([state[2] for state in states])[:, [*_FROM_BULLET, *(3 + k for k in _FROM_BULLET)]]
        torque = wrench[:, 3:] + np.cross(_CENTERS, wrench[:, :3])
        return np.asarray(np.abs(torque).max(axis=-1))

    def states(self) -> BodyStates:
        rows = [
            bullet.getLinkStates(
                self._figure,
                _LINKS,
                computeLinkVelocity=1,
                computeForwardKinematics=1,
                physicsClientId=client,
            )
            for client in self._clients
        ]
        flat = np.array([[(*s[0], *s[1], *s[6], *s[7]) for s in row] for row in rows])
        return BodyStates(
            flat[..., 0:3][..., _FROM_BULLET],
            flat[..., 3:7][..., _QUAT_FROM_BULLET],
            flat[..., 7:10][..., _FROM_BULLET],
            flat[..., 10:13][..., _FROM_BULLET],
        )

    def contacts(self) -> NDArray[np.bool_]:
        return np.array(
            [
                [
                    any(
                        point[8] < 1e-3
                        for point in bullet.getContactPoints(
                            bodyA=self._figure, linkIndexA=foot, physicsClientId=client
                        )
                    )
                    for foot in _FEET
                ]
                for client in self._clients
            ]
        )

    def peak_torques(self) -> Array:
        if not self._measure:
            raise RuntimeError("this world was made without measure_torques")
        return self._peaks.copy()

    def close(self) -> None:
        for client in self._clients:
            bullet.disconnect(physicsClientId=client)
        self._clients = []
