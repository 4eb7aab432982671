"""Our figure in raw pybullet, held by one of its two controllers; nothing is read back.

`stable_pd`: STABLE_PD_CONTROL, sent again before each of 8 substeps of 1/240 s, as it must be.
`motors`: Bullet's own motors, told once a control step where to go, with so many solver iterations
(pybullet's default is 50).
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import figure
import pybullet as bullet
from measuring import print_alone

from kinemimic.pipeline.gravity import GRAVITY
from kinemimic.retarget.formats.urdf import humanoid_urdf
from kinemimic.retarget.humanoid.body import BODIES
from kinemimic.train.reference.reference import Reference
from kinemimic.train.sim.world import CONTROL_RATE, FRICTION, SUBSTEPS, TIME_STEP, Poses

JOINTS = list(range(1, len(BODIES)))
STIFFNESS = [body.stiffness for body in BODIES[1:]]
DAMPING = [body.damping for body in BODIES[1:]]
LIMITS = [[body.torque_limit] * 3 for body in BODIES[1:]]
AXES = [1, 2, 0]  # Bullet's figure has X left, Y up, Z forward: its stable PD wants limbs along Y
QUATERNION = [1, 2, 0, 3]


class PybulletFigure:
    figures = 1
    seconds = 1.0 / CONTROL_RATE

    def __init__(self, control: str, iterations: int) -> None:
        self._client = bullet.connect(bullet.DIRECT)
        self._here = {"physicsClientId": self._client}
        bullet.setPhysicsEngineParameter(
            fixedTimeStep=TIME_STEP, numSolverIterations=iterations, numSubSteps=1, **self._here
        )
        bullet.setGravity(0, -GRAVITY, 0, **self._here)
        plane = bullet.createCollisionShape(bullet.GEOM_PLANE, planeNormal=[0, 1, 0], **self._here)
        ground = bullet.createMultiBody(0, plane, **self._here)
        bullet.changeDynamics(ground, -1, lateralFriction=1.0, **self._here)
        with tempfile.TemporaryDirectory() as folder:
            urdf = Path(folder) / "humanoid.urdf"
            urdf.write_text(humanoid_urdf("spherical", y_up=True))
            flags = bullet.URDF_USE_INERTIA_FROM_FILE | bullet.URDF_MAINTAIN_LINK_ORDER
            self._figure = bullet.loadURDF(str(urdf), flags=flags, **self._here)
        for link in range(-1, len(BODIES)):
            bullet.changeDynamics(
                self._figure, link, lateralFriction=FRICTION, linearDamping=0, angularDamping=0,
                jointDamping=0, activationState=bullet.ACTIVATION_STATE_DISABLE_SLEEPING, **self._here,
            )  # fmt: skip
        self._send, self._sends = (self._stable_pd, SUBSTEPS) if control == "stable_pd" else (self._motors, 1)
        for joint in JOINTS:  # the motors that every joint begins with would hold it
            bullet.setJointMotorControlMultiDof(
                self._figure, joint, bullet.POSITION_CONTROL, targetPosition=[0, 0, 0, 1], positionGain=0,
                velocityGain=0, force=[0, 0, 0], **self._here,
            )  # fmt: skip
            bullet.setJointMotorControl2(
                self._figure, joint, bullet.POSITION_CONTROL, targetPosition=0, positionGain=0,
                velocityGain=0, force=0, **self._here,
            )  # fmt: skip
        self._reference = Reference(figure.march())
        self._targets = [
            (q[0][..., QUATERNION].tolist(), v[0][..., AXES].tolist())
            for q, v in figure.targets(self._reference, 1)
        ]
        self._count = 0

    def _stable_pd(self, positions: list[list[float]], velocities: list[list[float]]) -> None:
        bullet.setJointMotorControlMultiDofArray(
            self._figure, JOINTS, bullet.STABLE_PD_CONTROL, targetPositions=positions,
            targetVelocities=velocities, forces=LIMITS, positionGains=STIFFNESS, velocityGains=DAMPING,
            **self._here,
        )  # fmt: skip

    def _motors(self, positions: list[list[float]], velocities: list[list[float]]) -> None:
        bullet.setJointMotorControlMultiDofArray(
            self._figure, JOINTS, bullet.POSITION_CONTROL, targetPositions=positions,
            targetVelocities=velocities, forces=LIMITS, **self._here,
        )  # fmt: skip

    def _put(self, poses: Poses) -> None:
        root, turn = poses.root[0, AXES].tolist(), poses.root_rotation[0, QUATERNION].tolist()
        bullet.resetBasePositionAndOrientation(self._figure, root, turn, **self._here)
        bullet.resetBaseVelocity(self._figure, [0, 0, 0], [0, 0, 0], **self._here)
        joints = poses.joints[0][:, QUATERNION].tolist()
        velocities = poses.joint_velocities[0][:, AXES].tolist()
        bullet.resetJointStatesMultiDof(self._figure, JOINTS, joints, velocities, **self._here)

    def stand(self) -> None:
        self._count = 0
        self._put(figure.standing(self._reference, 1))

    def fall(self) -> None:
        self._put(figure.falling(self._reference, 1))

    def step(self) -> None:
        positions, velocities = self._targets[self._count % figure.PERIOD]
        for substep in range(SUBSTEPS):
            if substep < self._sends:
                self._send(positions[substep], velocities[substep])
            bullet.stepSimulation(**self._here)
        self._count += 1

    def height(self) -> float:
        return float(bullet.getBasePositionAndOrientation(self._figure, **self._here)[0][1])


def open_stepper(control: str = "stable_pd", iterations: int = 10) -> PybulletFigure:
    return PybulletFigure(control, iterations)


if __name__ == "__main__":
    for control, iterations in (("stable_pd", 10), ("motors", 10), ("motors", 50)):
        print(f"{control}, {iterations} iterations", file=sys.stdout)
        print_alone(__file__, control=control, iterations=iterations)
