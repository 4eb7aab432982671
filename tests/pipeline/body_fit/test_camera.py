"""The camera's derivatives against finite differences, and what it sees of simple scenes."""

from __future__ import annotations

import numpy as np
import pytest

from kinemimic.pipeline.body_fit.camera import CAMERA_UNKNOWNS, SceneCamera, focal_of

CAMERA = SceneCamera((720, 1280), 950.0, 1.4, pitch=0.12, roll=-0.05)
POINTS = np.random.default_rng(0).uniform([2.0, -1.0, 0.0], [5.0, 1.0, 1.8], (20, 3))
STEP = 1e-6


def test_pixels_move_with_points_and_camera_as_the_derivatives_say() -> None:
    seen = CAMERA.seen(POINTS)
    before, by_point, by_camera = CAMERA.project(POINTS), CAMERA.by_point(seen), CAMERA.by_camera(seen)
    for axis in range(3):
        moved = CAMERA.project(POINTS + STEP * np.eye(3)[axis])
        assert (moved - before) / STEP == pytest.approx(by_point[..., axis], rel=1e-4, abs=1e-3)
    for k in range(len(CAMERA_UNKNOWNS)):
        moved = CAMERA.moved(STEP * np.eye(4)[k]).project(POINTS)
        assert (moved - before) / STEP == pytest.approx(by_camera[..., k], rel=1e-4, abs=1e-2)


def test_a_level_camera_sees_its_own_height_on_the_middle_line_and_left_on_the_left() -> None:
    level = SceneCamera((720, 1280), 950.0, 1.4)
    left, low = level.project(np.array([[3.0, 0.5, 1.4], [3.0, 0.0, 0.0]]))
    assert left == pytest.approx([360.0 - 950.0 * 0.5 / 3.0, 640.0])
    assert low == pytest.approx([360.0, 640.0 + 950.0 * 1.4 / 3.0])


def test_looking_down_moves_the_horizon_up() -> None:
    down = SceneCamera((720, 1280), 950.0, 1.4, pitch=np.radians(10.0))
    far = down.project(np.array([1e6, 0.0, 1.4]))
    assert far == pytest.approx([360.0, 640.0 - 950.0 * np.tan(np.radians(10.0))])


def test_the_field_of_view_is_along_the_longer_side() -> None:
    focal = focal_of((720, 1280), np.radians(67.0))
    assert 2.0 * np.degrees(np.arctan(640.0 / focal)) == pytest.approx(67.0)
    assert focal_of((1280, 720), np.radians(67.0)) == focal
