"""Obstacles on pybullet."""

from __future__ import annotations

import numpy as np

from kinemimic.train.sim.pybullet_client import QUAT_TO_BULLET, TO_BULLET, bullet
from kinemimic.train.sim.world import Obstacle


def build(client: int, item: Obstacle) -> int:
    """Add an obstacle to a client's world; returns its body's id."""
    x, _, z = item.size
    if item.shape == "box":
        half = 0.5 * np.array(item.size)[TO_BULLET]
        shape = bullet.createCollisionShape(
            bullet.GEOM_BOX, halfExtents=half.tolist(), physicsClientId=client
        )
    elif item.shape == "sphere":
        shape = bullet.createCollisionShape(bullet.GEOM_SPHERE, radius=0.5 * x, physicsClientId=client)
    else:
        # pybullet's cylinder is along its Z; ours is vertical, which is Y there.
        turn = [-(0.5**0.5), 0.0, 0.0, 0.5**0.5]
        shape = bullet.createCollisionShape(
            bullet.GEOM_CYLINDER, radius=0.5 * x, height=z, collisionFrameOrientation=turn,
            physicsClientId=client,
        )  # fmt: skip
    body: int = bullet.createMultiBody(item.mass, shape, physicsClientId=client)
    bullet.changeDynamics(body, -1, lateralFriction=1.0, physicsClientId=client)
    bullet.changeDynamics(
        body, -1, linearDamping=0, angularDamping=0,
        activationState=bullet.ACTIVATION_STATE_DISABLE_SLEEPING, physicsClientId=client,
    )  # fmt: skip
    if item.shape == "cylinder":
        # For a shape rotated in its body, Bullet takes the inertia of its bounding box.
        across, along = item.mass * (0.75 * x**2 + z**2) / 12, item.mass * x**2 / 8
        bullet.changeDynamics(body, -1, localInertiaDiagonal=[across, along, across], physicsClientId=client)
    start(client, body, item)
    return body


def start(client: int, body: int, item: Obstacle) -> None:
    """Reset it to its initial state."""
    position, rotation = np.array(item.position)[TO_BULLET], np.array(item.rotation)[QUAT_TO_BULLET]
    bullet.resetBasePositionAndOrientation(body, position.tolist(), rotation.tolist(), physicsClientId=client)
    bullet.resetBaseVelocity(
        body,
        np.array(item.velocity)[TO_BULLET].tolist(),
        np.array(item.spin)[TO_BULLET].tolist(),
        physicsClientId=client,
    )
