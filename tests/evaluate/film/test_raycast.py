"""A ray meets a solid where the solid's own definition says that its surface is."""

from __future__ import annotations

import numpy as np
import pytest

from kinemimic.evaluate.film.camera import Camera
from kinemimic.evaluate.film.raycast import bounds, cast
from kinemimic.evaluate.film.solids import Box, Capsule, Cylinder, Solid
from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import from_euler, to_matrix

SIZE = (120, 80)
CAMERA = Camera(np.array([-3.0, 0.4, 1.2]), 0.1, 0.15, 150.0, SIZE)
WHOLE = (0, 0, *SIZE)
RED = (1.0, 0.0, 0.0)
AXES = to_matrix(from_euler(np.array([0.4, -0.3, 0.8]), "ZXY"))
SOLIDS = {
    "capsule": Capsule(np.array([0.1, -0.2, 0.6]), np.array([-0.2, 0.3, 1.0]), 0.12, RED),
    "towards the camera": Capsule(np.array([-1.2, 0.3, 1.1]), np.array([0.4, 0.2, 0.9]), 0.1, RED),
    "sphere": Capsule(np.array([0.3, 0.3, 1.0]), np.array([0.3, 0.3, 1.0]), 0.25, RED),
    "cylinder": Cylinder(np.array([0.1, 0.1, 0.9]), 0.15, 0.3, AXES, RED),
    "disc": Cylinder(np.array([0.1, 0.1, 0.9]), 0.3, 0.05, AXES, RED),
    "box": Box(np.array([0.0, 0.1, 0.9]), np.array([0.1, 0.3, 0.2]), AXES, RED),
}


def outside(solid: Solid, points: Array) -> Array:
    """Signed distance (N,) of points (N, 3) from the surface, positive outside."""
    if isinstance(solid, Box):
        over = np.abs((points - solid.center) @ solid.axes) - solid.half
        return np.linalg.norm(np.maximum(over, 0), axis=1) + np.minimum(over.max(axis=1), 0)
    if isinstance(solid, Cylinder):
        own = (points - solid.center) @ solid.axes
        over = np.stack(
            [np.hypot(own[:, 0], own[:, 1]) - solid.radius, np.abs(own[:, 2]) - solid.half], axis=-1
        )
        return np.linalg.norm(np.maximum(over, 0), axis=1) + np.minimum(over.max(axis=1), 0)
    axis = solid.end - solid.start
    along = (points - solid.start) @ axis / max(axis @ axis, 1e-12)
    nearest = solid.start + np.clip(along, 0, 1)[:, None] * axis
    return np.linalg.norm(points - nearest, axis=1) - solid.radius


@pytest.mark.parametrize("solid", SOLIDS.values(), ids=SOLIDS.keys())
def test_rays_end_on_the_surface_and_miss_only_what_is_not_there(solid: Solid) -> None:
    surface = cast(CAMERA, [solid], WHOLE, CAMERA.rays(WHOLE, 1))
    hit = np.isfinite(surface.depth)
    np.testing.assert_array_equal(surface.where, np.flatnonzero(hit))
    assert 200 < hit.sum() < 0.8 * hit.size
    world = CAMERA.rays(WHOLE, 1).astype(float) @ CAMERA.axes
    points = CAMERA.position + surface.depth[hit][:, None] * world[hit]
    np.testing.assert_allclose(outside(solid, points), 0, atol=2e-5)
    # Nothing of the solid lies in front of the point that was found, or on a ray that found nothing.
    for share in np.linspace(0.01, 0.98, 60):
        before = CAMERA.position + share * surface.depth[hit][:, None] * world[hit]
        assert outside(solid, before).min() > 0
    for distance in np.linspace(0.2, 6, 400):
        assert outside(solid, CAMERA.position + distance * world[~hit]).min() > -2e-4
    # The normals point out of the solid, towards the camera, and have length 1.
    normals = surface.normals.astype(float) @ CAMERA.axes
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=5e-4)
    np.testing.assert_allclose(outside(solid, points + 0.01 * normals), 0.01, atol=1e-4)
    assert ((normals * world[hit]).sum(axis=1) < 1e-3).all()


@pytest.mark.parametrize("solid", SOLIDS.values(), ids=SOLIDS.keys())
def test_bounds_are_those_of_the_picture(solid: Solid) -> None:
    left, top, right, bottom = bounds(CAMERA, [solid], margin=0)
    rows, columns = np.nonzero(np.isfinite(cast(CAMERA, [solid], WHOLE, CAMERA.rays(WHOLE, 1)).depth))
    for bound, seen in (
        (left, columns.min()),
        (right, columns.max() + 1),
        (top, rows.min()),
        (bottom, rows.max() + 1),
    ):
        assert abs(bound - seen) <= 1
    assert left <= columns.min()
    assert right > columns.max()


def test_the_nearest_solid_is_seen_in_any_order() -> None:
    near, far = (
        SOLIDS["towards the camera"],
        Box(np.array([2.0, 0.2, 1.0]), np.full(3, 0.6), AXES, (0.0, 0.0, 1.0)),
    )
    rays = CAMERA.rays(WHOLE, 1)
    one, other = cast(CAMERA, [near, far], WHOLE, rays), cast(CAMERA, [far, near], WHOLE, rays)
    np.testing.assert_array_equal(one.colors, other.colors)
    alone = cast(CAMERA, [near], WHOLE, rays).where
    assert (one.colors[np.isin(one.where, alone)] == RED).all()
    assert len(alone) < len(one.where)


def test_solids_behind_the_camera_are_not_drawn() -> None:
    behind = Capsule(np.array([-5.0, 0.4, 1.2]), np.array([-6.0, 0.4, 1.2]), 0.3, RED)
    assert bounds(CAMERA, [behind]) == (0, 0, 0, 0)
    assert not len(cast(CAMERA, [behind], WHOLE, CAMERA.rays(WHOLE, 1)).where)


def test_a_ray_passes_the_pixel_of_its_points() -> None:
    rays = CAMERA.rays((20, 10, 60, 50), 2)
    assert rays.shape == (80, 80, 3)
    points = CAMERA.position + 2.5 * rays[7, 33].astype(float) @ CAMERA.axes
    np.testing.assert_allclose(CAMERA.project(points), [20 + 33.5 / 2, 10 + 7.5 / 2], atol=1e-3)
