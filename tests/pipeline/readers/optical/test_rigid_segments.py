"""Markers of a rigid pelvis and a rigid thigh that are hidden for a while."""

from __future__ import annotations

import numpy as np
import pytest

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import from_rotvec, to_matrix
from kinemimic.pipeline.readers.optical.rigid_segments import fill_rigid

FRAMES = 100
FOUND = {"asis_left": (0,), "asis_right": (1,), "psis_left": (2,), "psis_right": (3,)}
SHAPE = np.array([[0.1, 0.12, 0.0], [0.1, -0.12, 0.0], [-0.06, 0.05, 0.03], [-0.06, -0.05, 0.03]])


def moving(shape: Array) -> Array:
    """Places (T, n, 3), metres, of markers on a body that walks and turns."""
    clock = np.linspace(0.0, 6.0, FRAMES)
    turns = to_matrix(from_rotvec(np.stack([0.1 * np.sin(clock), 0.2 * np.cos(clock), 0.5 * clock], axis=1)))
    way = np.stack([clock, np.sin(clock), np.ones(FRAMES)], axis=1)
    return np.asarray(np.einsum("tij,nj->tni", turns, shape) + way[:, None])


@pytest.mark.parametrize("mirror", [1.0, -1.0])
def test_a_hidden_marker_is_where_the_others_put_it(mirror: float) -> None:
    true = moving(SHAPE) * [1.0, mirror, 1.0]
    shown = true.copy()
    shown[20:60, 2] = np.nan  # much longer than any gap that may be interpolated
    shown[50:80, 0] = np.nan  # for a while two are missing, and nothing shows the rotation
    shown[95:, 3] = np.nan
    points, filled = fill_rigid(shown, FOUND)
    both = slice(50, 60)
    assert np.isnan(points[both][:, [0, 2]]).all()
    assert np.isfinite(np.delete(points, np.arange(50, 60), axis=0)).all()
    assert np.nanmax(np.abs(points - true)) < 1e-9
    assert np.array_equal(filled, np.isnan(shown).any(axis=-1) & np.isfinite(points).all(axis=-1))


def test_the_filled_path_joins_the_measured_one() -> None:
    """A marker that has slid by 1 cm over the skin does not jump at the ends of its gap."""
    true = moving(SHAPE)
    true[:, 2] += np.linspace(0.0, 0.01, FRAMES)[:, None] * [0.0, 0.0, 1.0]
    shown = true.copy()
    shown[60:90, 2] = np.nan
    points, _ = fill_rigid(shown, FOUND)
    assert np.abs(points - true).max() < 0.001


def test_markers_in_one_line_show_no_rotation() -> None:
    line = {"thigh_left": (0, 1, 2), "knee_lateral_left": (3,)}
    shape = np.array([[0.0, 0.0, 0.0], [0.0, 0.001, -0.1], [0.0, 0.0, -0.2], [0.05, 0.0, -0.3]])
    shown = moving(shape)
    shown[40:60, 3] = np.nan
    points, filled = fill_rigid(shown, line)
    assert not filled.any()
    assert np.array_equal(points, shown, equal_nan=True)


def test_three_markers_or_a_marker_never_seen_with_the_others_fill_nothing() -> None:
    shown = moving(SHAPE)
    shown[40:60, 0] = np.nan
    assert not fill_rigid(shown[:, :3], {name: FOUND[name] for name in list(FOUND)[:3]})[1].any()
    shown[:40, 1] = shown[60:, 1] = np.nan
    assert not fill_rigid(shown, FOUND)[1].any()
