"""Triangle meshes of the 15 collision shapes, for programs that draw."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.retarget.humanoid.body import Body

_AROUND, _CAP = 20, 6  # segments around a capsule, and from its side to its pole


@dataclass(frozen=True)
class Mesh:
    """vertices, normals: (V, 3) m, in the frame of the body's node; triangles: (F, 3) indices, seen
    counter-clockwise from outside."""

    vertices: Array
    normals: Array
    triangles: NDArray[np.int64]


def body_mesh(body: Body) -> Mesh:
    """The shape of a body as it is simulated: an ellipsoid of Table 1 is the capsule of its length."""
    size = np.array(body.size)
    mesh = _box(0.5 * size) if body.shape == "box" else _capsule(0.5 * size[0], 0.5 * (size[2] - size[0]))
    return Mesh(mesh.vertices + np.array(body.center), mesh.normals, mesh.triangles)


def _box(half: Array) -> Mesh:
    vertices: list[Array] = []
    normals: list[Array] = []
    triangles: list[list[int]] = []
    for axis in range(3):
        across, up = np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]
        for sign in (-1.0, 1.0):
            normal = sign * np.eye(3)[axis]
            first = len(vertices)
            vertices += [
                half * (normal + a * sign * across + b * up) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))
            ]
            normals += [normal] * 4
            triangles += [[first, first + 1, first + 2], [first, first + 2, first + 3]]
    return Mesh(np.array(vertices), np.array(normals), np.array(triangles))


def _capsule(radius: float, half: float) -> Mesh:
    """Along Z, from -half to half; a sphere if that is zero."""
    # Rings from the lower pole to the upper one; the equator twice, once at each end of the side.
    lower = np.linspace(-0.5 * np.pi, 0.0, _CAP + 1)
    slope = np.concatenate([lower, -lower[::-1]])
    turn = np.arange(_AROUND + 1) * 2 * np.pi / _AROUND
    normals = np.stack(
        np.broadcast_arrays(
            np.cos(slope)[:, None] * np.cos(turn),
            np.cos(slope)[:, None] * np.sin(turn),
            np.sin(slope)[:, None],
        ),
        axis=-1,
    )
    vertices = radius * normals
    vertices[: _CAP + 1, :, 2] -= half
    vertices[_CAP + 1 :, :, 2] += half
    rings, columns = len(slope), _AROUND + 1
    corner = (np.arange(rings - 1)[:, None] * columns + np.arange(_AROUND)).ravel()
    quads = np.stack([corner, corner + 1, corner + columns + 1, corner + columns], axis=-1)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    flat = vertices.reshape(-1, 3)
    # No area: at the poles, and the side of a sphere.
    a, b, c = (flat[triangles[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return Mesh(flat, normals.reshape(-1, 3), triangles[area > 1e-12])
