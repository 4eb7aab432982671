"""The humanoid on pybullet, alone on the ground in its own client."""

from __future__ import annotations

from pathlib import Path

from kinemimic.pipeline.gravity import GRAVITY
from kinemimic.retarget.humanoid.body import BODIES
from kinemimic.train.sim.pybullet_client import bullet
from kinemimic.train.sim.world import CONTACT_ERP, SOLVER_ITERATIONS, SPEED_LIMIT, TIME_STEP

LINKS = list(range(len(BODIES)))  # link k is BODIES[k]
JOINT_LINKS = LINKS[1:]
STIFFNESS = [body.stiffness for body in BODIES[1:]]
DAMPING = [body.damping for body in BODIES[1:]]
LIMITS = [[body.torque_limit] * 3 for body in BODIES[1:]]

Weights = list[tuple[float, tuple[float, float, float]]]


def build_humanoid(urdf: Path, *, measure: bool) -> tuple[int, int]:
    """A client and the humanoid's id in it. measure: whether the joints' sensors are on."""
    client: int = bullet.connect(bullet.DIRECT)
    if client < 0:
        raise RuntimeError("pybullet has no more physics clients in this process")
    bullet.setPhysicsEngineParameter(
        fixedTimeStep=TIME_STEP,
        numSolverIterations=SOLVER_ITERATIONS,
        numSubSteps=1,
        contactERP=CONTACT_ERP,
        physicsClientId=client,
    )
    bullet.setGravity(0, -GRAVITY, 0, physicsClientId=client)
    plane = bullet.createCollisionShape(bullet.GEOM_PLANE, planeNormal=[0, 1, 0], physicsClientId=client)
    ground = bullet.createMultiBody(0, plane, physicsClientId=client)
    # Bullet multiplies the frictions of two bodies.
    bullet.changeDynamics(ground, -1, lateralFriction=1.0, physicsClientId=client)
    flags = bullet.URDF_USE_INERTIA_FROM_FILE | bullet.URDF_MAINTAIN_LINK_ORDER
    humanoid: int = bullet.loadURDF(str(urdf), [0, 2, 0], flags=flags, physicsClientId=client)
    # These belong to the whole humanoid: in the call for a link, Bullet ignores that call's other arguments.
    bullet.changeDynamics(
        humanoid, -1, linearDamping=0, angularDamping=0, maxJointVelocity=SPEED_LIMIT,
        activationState=bullet.ACTIVATION_STATE_DISABLE_SLEEPING, physicsClientId=client,
    )  # fmt: skip
    for link in LINKS:
        bullet.changeDynamics(humanoid, link, jointDamping=0, physicsClientId=client)
    for joint in JOINT_LINKS:
        # Both kinds of default motors would hold the joint.
        bullet.setJointMotorControlMultiDof(
            humanoid, joint, bullet.POSITION_CONTROL, targetPosition=[0, 0, 0, 1], positionGain=0,
            velocityGain=0, force=[0, 0, 0], physicsClientId=client,
        )  # fmt: skip
        bullet.setJointMotorControl2(
            humanoid, joint, bullet.POSITION_CONTROL, targetPosition=0, positionGain=0, velocityGain=0,
            force=0, physicsClientId=client,
        )  # fmt: skip
        if measure:
            bullet.enableJointForceTorqueSensor(humanoid, joint, True, physicsClientId=client)
    # At its first command the stable PD stores the bodies' masses for good: here the nominal ones of the
    # file. Without any force the command has no other effect.
    still = [[0.0, 0.0, 0.0]] * len(JOINT_LINKS)
    control(client, humanoid, [[0.0, 0.0, 0.0, 1.0]] * len(JOINT_LINKS), still, still)
    return client, humanoid


def control(
    client: int,
    humanoid: int,
    targets: list[list[float]],
    velocities: list[list[float]],
    limits: list[list[float]],
) -> None:
    """Stable PD towards 14 rotations and velocities within torque limits, for the next step."""
    bullet.setJointMotorControlMultiDofArray(
        humanoid, JOINT_LINKS, bullet.STABLE_PD_CONTROL, targetPositions=targets, targetVelocities=velocities,
        forces=limits, positionGains=STIFFNESS, velocityGains=DAMPING, physicsClientId=client,
    )  # fmt: skip


def nominal_weights(client: int, humanoid: int) -> Weights:
    """Mass, kg, and principal moments, kg·m², of the base and of every link."""
    found = (bullet.getDynamicsInfo(humanoid, link, physicsClientId=client) for link in (-1, *LINKS))
    return [(info[0], info[2]) for info in found]


def vary_humanoid(client: int, humanoid: int, nominal: Weights, friction: float, mass: float) -> None:
    """Set the humanoid's friction, and `mass` times its nominal masses and inertias."""
    for link, (own, moments) in enumerate(nominal, start=-1):
        # In one call: with a mass alone, Bullet computes the moments from the shapes.
        bullet.changeDynamics(
            humanoid, link, mass=mass * own, localInertiaDiagonal=[mass * moment for moment in moments],
            lateralFriction=friction, physicsClientId=client,
        )  # fmt: skip
