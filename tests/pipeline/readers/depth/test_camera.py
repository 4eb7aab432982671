"""Pixels to metres and back, compared with rays computed without OpenCV."""

from __future__ import annotations

from dataclasses import astuple

import numpy as np
import pytest
from samples.depth_scene import AZURE, BARREL, Lens, millimetres, plane, sphere

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.readers.depth.camera import Camera

LENSES = pytest.mark.parametrize("lens", [AZURE, BARREL], ids=["azure", "barrel"])


def camera_of(lens: Lens) -> Camera:
    return Camera(*astuple(lens))


def seen(lens: Lens, depth: Array) -> tuple[Array, Array, Array]:
    """Back-projected points (N, 3) of a 16-bit image, the true points (N, 3), and pixels (N, 2)."""
    image = millimetres(depth)
    v, u = np.nonzero(image)
    pixels = np.stack([u, v], axis=-1).astype(np.float64)
    found = camera_of(lens).back_project(pixels, image[v, u] / 1000.0)
    return found, (lens.rays * np.where(np.isfinite(depth), depth, 0.0)[..., None])[v, u], pixels


@LENSES
def test_a_sphere_is_found_again_within_2_mm(lens: Lens) -> None:
    # Off the axis, where the lens bends most.
    centre, radius = np.array([0.9, 0.5, 2.2]), 0.4
    found, true, _ = seen(lens, sphere(lens, centre, radius))
    assert len(found) > 1000
    assert np.linalg.norm(found - true, axis=-1).max() < 0.002
    # Where its flank falls away steeply, half a millimetre along the ray is still half a millimetre.
    assert np.abs(np.linalg.norm(found - centre, axis=-1) - radius).max() < 0.002


@LENSES
def test_a_slanted_plane_is_flat_up_to_the_corners(lens: Lens) -> None:
    normal = np.array([0.3, -0.2, 1.0]) / np.linalg.norm([0.3, -0.2, 1.0])
    found, true, pixels = seen(lens, plane(lens, normal, 2.5))
    assert len(found) == lens.width * lens.height
    assert np.linalg.norm(found - true, axis=-1).max() < 0.002
    assert np.abs(found @ normal - 2.5).max() < 0.002
    assert np.abs(camera_of(lens).project(found) - pixels).max() < 0.01


@LENSES
def test_projection_is_the_written_out_distortion(lens: Lens) -> None:
    points = np.random.default_rng(0).uniform([-0.8, -0.6, 1.5], [0.8, 0.6, 4.0], (200, 3))
    assert camera_of(lens).project(points) == pytest.approx(lens.project(points), abs=1e-6)


def test_without_the_lens_the_error_would_be_centimetres() -> None:
    # That the tests above test the distortion at all.
    straight = Camera(*astuple(AZURE)[:6])
    found = straight.back_project(np.array([[600.0, 500.0]]), np.array([2.0]))
    assert np.linalg.norm(found - AZURE.rays[500, 600] * 2.0) > 0.02


def test_points_outside_the_lens_have_no_pixel() -> None:
    camera = camera_of(BARREL)
    # A barrel's polynomial folds back: far aside it would put a point into the middle of the image.
    far_aside, behind = [4.0, 0.0, 1.0], [0.1, 0.0, -2.0]
    folded = BARREL.project(np.array(far_aside))
    assert np.isfinite(folded).all()
    assert np.isnan(camera.project(np.array([far_aside, behind, [np.nan] * 3]))).all()
    assert camera.project(np.empty((0, 3))).shape == (0, 2)


def test_missing_pixels_stay_missing() -> None:
    camera = camera_of(AZURE)
    pixels = np.array([[[np.nan, 4.0], [320.0, 326.0]]])
    points = camera.back_project(pixels, np.array([[1.0, np.nan]]))
    assert np.isnan(points[0, 0, :2]).all()
    assert np.isnan(points[0, 1]).all()


def test_the_image_ends_half_a_pixel_beyond_its_middles() -> None:
    camera = camera_of(AZURE)
    edges = np.array([[-0.5, 0.0], [-0.51, 0.0], [639.49, 575.49], [639.5, 0.0], [np.nan, 0.0]])
    assert camera.inside(edges).tolist() == [True, False, True, False, False]
