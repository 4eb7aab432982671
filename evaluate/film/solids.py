"""Solids to draw: those of the humanoid as it is simulated, and obstacles."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import rotate, to_matrix
from kinemimic.retarget.humanoid.body import BODIES, BODY_NODES
from kinemimic.train.sim.world import Obstacle

Color = tuple[float, float, float]  # red, green, blue, 0 to 1


@dataclass(frozen=True)
class Capsule:
    """The points within `radius` of the segment from start (3,) to end (3,); a sphere if both are equal."""

    start: Array
    end: Array
    radius: float
    color: Color

    def extent(self) -> tuple[Array, float]:
        """Points (K, 3) and a radius: the solid lies in the hull of the spheres around them."""
        return np.stack([self.start, self.end]), self.radius


@dataclass(frozen=True)
class Box:
    """A box: center (3,), half of its size (3,), and the rotation (3, 3) from its axes to the world's."""

    center: Array
    half: Array
    axes: Array
    color: Color

    def extent(self) -> tuple[Array, float]:
        """As of `Capsule`."""
        signs = np.array([[a, b, c] for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)])
        return self.center + (signs * self.half) @ self.axes.T, 0.0


@dataclass(frozen=True)
class Cylinder:
    """A cylinder along its third axis: center (3,), half of its height, rotation (3, 3) from its axes to the
    world's."""

    center: Array
    radius: float
    half: float
    axes: Array
    color: Color

    def extent(self) -> tuple[Array, float]:
        """As of `Capsule`."""
        angles, around = np.arange(16) * np.pi / 8, self.radius / np.cos(np.pi / 16)
        ring = around * np.stack([np.cos(angles), np.sin(angles), np.zeros(16)], axis=-1)
        up = np.array([0.0, 0.0, self.half])
        rings = np.concatenate([ring + up, ring - up])
        return self.center + rings @ self.axes.T, 0.0


Solid = Capsule | Box | Cylinder


def obstacle_solid(obstacle: Obstacle, state: Array, color: Color) -> Solid:
    """An obstacle in the state (7 or more) of `World.obstacles`: position and rotation."""
    center, half, axes = state[:3], 0.5 * np.array(obstacle.size), to_matrix(state[3:7])
    if obstacle.shape == "box":
        return Box(center, half, axes, color)
    if obstacle.shape == "sphere":
        return Capsule(center, center, float(half[0]), color)
    return Cylinder(center, float(half[0]), float(half[2]), axes, color)


def shaded_side(color: Color, name: str) -> Color:
    """A body's colour: limbs on the right are darker, so that the legs can be told apart."""
    dim = 0.80 if name.endswith("_right") else 1.0
    return color[0] * dim, color[1] * dim, color[2] * dim


def body_solids(positions: Array, rotations: Array, color: Color) -> Iterator[Solid]:
    """The 15 collision shapes of the body in one frame: nodes (20, 3) and their rotations (20, 4).

    An ellipsoid of Table 1 is simulated, and drawn, as the capsule of its length.
    """
    for body, node in zip(BODIES, BODY_NODES.tolist(), strict=True):
        size, place, turn = np.array(body.size), positions[node], rotations[node]
        center = place + rotate(turn, np.array(body.center))
        painted = shaded_side(color, body.name)
        if body.shape == "box":
            yield Box(center, 0.5 * size, to_matrix(turn), painted)
        else:
            half = rotate(turn, np.array([0.0, 0.0, 0.5 * (size[2] - size[0])]))
            yield Capsule(center + half, center - half, 0.5 * float(size[0]), painted)
