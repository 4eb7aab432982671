"""What a policy observes of obstacles: the nearest ones, and how far they are from its legs.

All numbers are 0 where no obstacle is near, and fade in as one approaches.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import conjugate, rotate
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.retarget.humanoid.body import BODIES, BODY_INDEX
from kinemimic.train.sim.world import BodyStates, Obstacle, Shape, World
from kinemimic.train.task.heading_frame import in_heading_frame

_SHAPES: tuple[str, ...] = get_args(Shape)
_BOX, _SPHERE = _SHAPES.index("box"), _SHAPES.index("sphere")
# An obstacle is observed in full from _WHOLE m on, and not at all beyond _NONE m: the distance on the ground
# of its centre from a point _AHEAD m in front of the pelvis.
_AHEAD, _WHOLE, _NONE = 0.2, 1.2, 1.8
FARTHEST, LARGEST, FASTEST = 2.0, 1.0, 3.0  # m, m, m/s: larger numbers are observed as these
OBSTACLE_SIZE = 14  # numbers of an obstacle
_EXTENT = np.triu_indices(3)  # xx, xy, xz, yy, yz, zz
# Signs of a reflection at y = 0: nearness, place, velocity, extent, roundness.
_OBSTACLE_SIGNS: Array = np.array([1.0, *(1.0, -1.0, 1.0) * 2, 1.0, -1.0, 1.0, 1.0, -1.0, 1.0, 1.0])

REACH, UNIT = 0.7, 0.3  # m: distance of a leg from which a surface is observed; unit of the vectors to it


def _leg_points(side: str) -> list[tuple[int, tuple[float, float, float]]]:
    """Body and place in its frame, m, of the toes, the heel, the middle of the shin and the knee."""
    foot, shin = BODY_INDEX[f"foot_{side}"], BODY_INDEX[f"shin_{side}"]
    length, _, thickness = BODIES[foot].size
    sole, knee = -0.5 * thickness, 0.5 * BODIES[shin].size[2]
    return [
        (foot, (0.5 * length, 0.0, sole)),
        (foot, (-0.5 * length, 0.0, sole)),
        (shin, (0.0, 0.0, 0.0)),
        (shin, (0.0, 0.0, knee)),
    ]


_POINTS = [point for side in SIDES for point in _leg_points(side)]
_POINT_BODIES = [body for body, _ in _POINTS]
_POINT_PLACES: Array = np.array([place for _, place in _POINTS])
LEGS_SIZE = 4 * len(_POINTS)  # numbers of the distances from the legs


def obstacle_observation_size(count: int) -> int:
    """Size of `observe_obstacles`; 0 where no obstacle is observed."""
    return count * OBSTACLE_SIZE + LEGS_SIZE if count else 0


@dataclass(frozen=True)
class ObstacleStates:
    """K obstacles of each of E humanoids, in the world; rows beyond a humanoid's own are not `there`.

    there: (E, K); shapes: (E, K) indices in the order of `Shape`; positions, linear: (E, K, 3) m, m/s;
    rotations: (E, K, 4); sizes: (E, K, 3) outer dimensions, m, with the diameter of round ones in each that
    has it.
    """

    there: NDArray[np.bool_]
    shapes: NDArray[np.int64]
    positions: Array
    rotations: Array
    linear: Array
    sizes: Array

    def taken(self, order: NDArray[np.intp]) -> ObstacleStates:
        """Obstacles (E, N) by their numbers."""
        columns = (getattr(self, f.name) for f in fields(self))
        return ObstacleStates(*(column[np.arange(len(order))[:, None], order] for column in columns))


def obstacle_states(world: World) -> ObstacleStates | None:
    """All obstacles now; None if there are none."""
    placed = [world.placed(index) for index in range(world.size)]
    most = max(len(items) for items in placed)
    if not most:
        return None
    size = (world.size, most)
    there, shapes = np.zeros(size, dtype=np.bool_), np.zeros(size, dtype=np.int64)
    states, sizes = np.zeros((*size, 13)), np.zeros((*size, 3))
    states[..., 6] = 1.0  # a rotation
    for index, items in enumerate(placed):
        if count := len(items):
            there[index, :count] = True
            shapes[index, :count] = [_SHAPES.index(item.shape) for item in items]
            sizes[index, :count] = [_outer(item) for item in items]
            states[index, :count] = world.obstacles(index)
    return ObstacleStates(there, shapes, states[..., 0:3], states[..., 3:7], states[..., 7:10], sizes)


def _outer(item: Obstacle) -> tuple[float, float, float]:
    """Outer dimensions, m: of a round obstacle, `Obstacle` reads the diameter from the first number alone."""
    x, y, z = item.size
    return {"box": (x, y, z), "sphere": (x, x, x), "cylinder": (x, x, z)}[item.shape]


def observe_obstacles(
    count: int, obstacles: ObstacleStates | None, bodies: BodyStates, heading: Array
) -> Array:
    """(E, count * OBSTACLE_SIZE + LEGS_SIZE) the `count` nearest obstacles and the distances from the legs.

    Vectors are in the frame of the headings (E,), radians about the vertical, as in `observation.observe`.
    """
    size = len(heading)
    found = np.zeros((size, count * OBSTACLE_SIZE + LEGS_SIZE))
    if obstacles is None:
        return found
    nearest = _nearest(count, obstacles, bodies, heading)
    found[:, : nearest.shape[1]] = nearest
    found[:, count * OBSTACLE_SIZE :] = _from_legs(obstacles, bodies, heading)
    return found


def obstacle_reflection(count: int) -> tuple[NDArray[np.intp], Array]:
    """Index and sign of every number of `observe_obstacles` that reflect it (`mirror.py`)."""
    legs = np.arange(LEGS_SIZE).reshape(2, -1)[::-1].ravel()
    sources = np.concatenate([np.arange(count * OBSTACLE_SIZE), count * OBSTACLE_SIZE + legs])
    signs = [np.tile(_OBSTACLE_SIGNS, count), np.tile([1.0, -1.0, 1.0, 1.0], len(_POINTS))]
    return sources, np.concatenate(signs)


def _nearest(count: int, obstacles: ObstacleStates, bodies: BodyStates, heading: Array) -> Array:
    """(E, N * OBSTACLE_SIZE) of the N <= count nearest obstacles."""
    below = bodies.positions[:, None, 0] * [1.0, 1.0, 0.0]
    places = in_heading_frame(obstacles.positions - below, heading)
    distances = np.hypot(places[..., 0] - _AHEAD, places[..., 1]) + np.where(obstacles.there, 0.0, np.inf)
    order = np.argsort(distances, axis=1, kind="stable")[:, :count]
    near = obstacles.taken(order)
    rows = np.arange(len(order))[:, None]
    places, distances = places[rows, order], distances[rows, order]
    nearness = np.clip((_NONE - distances) / (_NONE - _WHOLE), 0.0, 1.0)[..., None]
    parts = [
        np.ones(nearness.shape),
        np.clip(places, -FARTHEST, FARTHEST),
        np.clip(in_heading_frame(near.linear, heading), -FASTEST, FASTEST),
        _extents(near, heading),
        (near.shapes != _BOX)[..., None],
    ]
    found: Array = (nearness * np.concatenate(parts, axis=-1)).reshape(len(order), -1)
    return found


def _from_legs(obstacles: ObstacleStates, bodies: BodyStates, heading: Array) -> Array:
    """(E, LEGS_SIZE) for each point of the legs, the vector to the nearest surface, in units of 0.3 m, and
    the nearness, from 0 at REACH to 1 at the surface, with which the vector is multiplied."""
    arms = rotate(
        bodies.rotations[:, _POINT_BODIES],
        np.broadcast_to(_POINT_PLACES, (len(heading), *_POINT_PLACES.shape)),
    )
    points = (bodies.positions[:, _POINT_BODIES] + arms)[:, :, None]  # (E, P, 1, 3)
    turns = np.broadcast_to(obstacles.rotations[:, None], (*points.shape[:2], obstacles.there.shape[1], 4))
    local = rotate(conjugate(turns), points - obstacles.positions[:, None])
    ways = rotate(turns, _closest(local, obstacles) - local)
    distances = np.linalg.norm(ways, axis=-1) + np.where(obstacles.there, 0.0, np.inf)[:, None]
    which = distances.argmin(axis=-1)[..., None]
    distances = np.take_along_axis(distances, which, axis=-1)
    ways = np.take_along_axis(ways, which[..., None], axis=2)[:, :, 0]
    nearness = np.clip(1.0 - distances / REACH, 0.0, 1.0)
    found: Array = np.concatenate([nearness * in_heading_frame(ways, heading) / UNIT, nearness], axis=-1)
    return found.reshape(len(heading), -1)


def _closest(points: Array, obstacles: ObstacleStates) -> Array:
    """Points of the obstacles closest to points (E, P, K, 3), both in the obstacles' frames."""
    half = 0.5 * obstacles.sizes[:, None]
    inside = np.clip(points, -half, half)
    radius = half[..., :1]
    # Of a cylinder, the distance from its axis; of a sphere, from its centre.
    across = np.linalg.norm(points[..., :2], axis=-1, keepdims=True)
    share = np.minimum(1.0, radius / np.maximum(across, 1e-9))
    in_cylinder = np.concatenate([points[..., :2] * share, inside[..., 2:]], axis=-1)
    share = np.minimum(1.0, radius / np.maximum(np.linalg.norm(points, axis=-1, keepdims=True), 1e-9))
    shapes = obstacles.shapes[:, None, :, None]
    closest: Array = np.where(
        shapes == _BOX, inside, np.where(shapes == _SPHERE, points * share, in_cylinder)
    )
    return closest


def _extents(obstacles: ObstacleStates, heading: Array) -> Array:
    """(E, N, 6) the symmetric matrices Σ sᵢ aᵢ aᵢᵀ of the outer dimensions s, m, and axes a of obstacles.

    Turns that leave an obstacle the same change nothing, and every other turn changes it smoothly, which axes
    alone do not: the axis of a lying cylinder has two directions.
    """
    rotations, sizes = obstacles.rotations, np.minimum(obstacles.sizes, LARGEST)
    shape = (*rotations.shape[:-1], 3)
    axes = [
        in_heading_frame(rotate(rotations, np.broadcast_to(np.eye(3)[k], shape)), heading) for k in range(3)
    ]
    columns = np.stack(axes, axis=-1)
    matrices = (columns * sizes[..., None, :]) @ columns.swapaxes(-1, -2)
    found: Array = matrices[..., _EXTENT[0], _EXTENT[1]]
    return found
