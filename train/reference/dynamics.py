"""Inverse dynamics: joint torques of a reference, with the contacts that it implies.

Newton-Euler gives each body's force and moment from its motion. The ground must provide the rest: forces in
friction cones at points of the body that are low and slow, found by non-negative least squares. The residual
(a recorded motion is never perfectly physical) remains at the root, which has no motor. Torques then follow
from the leaves to the root (Featherstone 2008, chapter 5).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.gravity import GRAVITY
from kinemimic.pipeline.kinematics.rotations import conjugate, rotate
from kinemimic.retarget.humanoid.body import (
    BODIES,
    BODY_CENTERS,
    BODY_INERTIAS,
    BODY_MASSES,
    BODY_PARENTS,
    Body,
)
from kinemimic.train.sim.world import FRICTION, BodyStates

# The higher a point is above the ground, and the faster it moves, the less it carries.
HEIGHT = 0.015  # m
SPEED = 0.4  # m/s
BEYOND = 3.0  # at these multiples, it carries nothing
COST = 1e-3  # of a newton at a point at rest on the ground, relative to a newton of residual
STEPS = 100  # maximum of the solver per unknown: its own 3 can be too few for a sole's similar corners
LEVER = 0.3  # m: a newton metre of residual counts as a newton at this distance
CONE = FRICTION / np.sqrt(2.0) * np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])  # edges, inside the cone


def _points(body: Body) -> Array:
    """Contact points (P, 4) of a body: position from its centre in its frame, and a radius."""
    x, y, z = (0.5 * s for s in body.size)
    if body.shape == "box":
        corners = [(a * x, b * y, c * z, 0.0) for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)]
        return np.array(corners)
    if body.shape == "sphere":
        return np.array([[0.0, 0.0, 0.0, x]])
    return np.array([[0.0, 0.0, sign * (z - x), x] for sign in (-1, 1)])


_POINTS = [(index, _points(body)) for index, body in enumerate(BODIES)]
_OWNER = np.concatenate([np.full(len(points), index) for index, points in _POINTS])
_PLACES = np.concatenate([points for _, points in _POINTS])


@dataclass(frozen=True)
class InverseDynamics:
    """torques: (T, 14, 3) of each joint on its child, in the child's frame, N·m; ground: (T, 3) force of the
    ground on the humanoid, N; missing: (T, 6) residual force and moment about the pelvis, N and N·m, in the
    world."""

    torques: Array
    ground: Array
    missing: Array


def inverse_dynamics(bodies: BodyStates, linear_rate: Array, angular_rate: Array) -> InverseDynamics:
    """Torques and forces of the motion of 15 bodies (T, 15, ...) with accelerations (T, 15, 3) in the
    world."""
    frames = len(bodies.positions)
    spin = rotate(conjugate(bodies.rotations), bodies.angular)
    turn = rotate(conjugate(bodies.rotations), angular_rate)
    forces = BODY_MASSES[:, None] * (linear_rate + np.array([0.0, 0.0, GRAVITY]))
    moments = rotate(bodies.rotations, BODY_INERTIAS * turn + np.cross(spin, BODY_INERTIAS * spin))
    joints = bodies.positions - rotate(bodies.rotations, np.broadcast_to(BODY_CENTERS, (frames, 15, 3)))
    places = _contact_places(bodies)
    about_root = (moments + np.cross(bodies.positions - joints[:, :1], forces)).sum(axis=1)
    contact = _contact_forces(bodies, places, joints[:, 0], forces.sum(axis=1), about_root)
    turning = np.cross(places - bodies.positions[:, _OWNER], contact)
    for point, owner in enumerate(_OWNER):
        forces[:, owner] -= contact[:, point]
        moments[:, owner] -= turning[:, point]
    # From the leaves: each joint gives its child's force and moment, which the parent then needs in addition.
    force, moment = forces.copy(), moments + np.cross(bodies.positions - joints, forces)
    for index in range(len(BODIES) - 1, 0, -1):
        parent = BODY_PARENTS[index]
        force[:, parent] += force[:, index]
        moment[:, parent] += moment[:, index] + np.cross(
            joints[:, index] - joints[:, parent], force[:, index]
        )
    torques = rotate(conjugate(bodies.rotations[:, 1:]), moment[:, 1:])
    return InverseDynamics(torques, contact.sum(axis=1), np.concatenate([force[:, 0], moment[:, 0]], axis=-1))


def _contact_places(bodies: BodyStates) -> Array:
    """World positions (T, P, 3) of the contact points of all bodies, at the bottom of their spheres."""
    shape = (len(bodies.positions), len(_OWNER), 3)
    places = bodies.positions[:, _OWNER] + rotate(
        bodies.rotations[:, _OWNER], np.broadcast_to(_PLACES[:, :3], shape)
    )
    places[..., 2] -= _PLACES[:, 3]
    return places


def _contact_forces(bodies: BodyStates, places: Array, root: Array, force: Array, moment: Array) -> Array:
    """Forces (T, P, 3) at contact points (T, P, 3) that come nearest to a force and a moment (T, 3) about the
    root (T, 3), all in the world."""
    velocities = bodies.linear[:, _OWNER] + np.cross(
        bodies.angular[:, _OWNER], places - bodies.positions[:, _OWNER]
    )
    height = np.maximum(places[..., 2], 0.0) / HEIGHT
    slip = np.sqrt(np.sum(velocities**2, axis=-1)) / SPEED
    pushes = np.concatenate([CONE, np.ones((4, 1))], axis=1)  # (4, 3): force per unit along each edge
    wanted = np.concatenate([force, moment / LEVER], axis=-1)
    contact = np.zeros_like(places)
    for t in range(len(places)):
        near = np.flatnonzero((height[t] < BEYOND) & (slip[t] < BEYOND))
        if not len(near):
            continue
        unit = np.repeat(pushes[None], len(near), axis=0)  # (P, 4, 3)
        turn = np.cross((places[t, near] - root[t])[:, None], unit) / LEVER
        matrix = np.concatenate([unit, turn], axis=-1).reshape(-1, 6).T  # (6, 4 P)
        cost = COST * np.exp(0.5 * (height[t, near] ** 2 + slip[t, near] ** 2))
        system = np.concatenate([matrix, np.diag(np.repeat(cost, 4))])
        found, _ = nnls(
            system, np.concatenate([wanted[t], np.zeros(4 * len(near))]), maxiter=STEPS * 4 * len(near)
        )
        contact[t, near] = np.einsum("pk,pki->pi", found.reshape(-1, 4), unit)
    return contact
