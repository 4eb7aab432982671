"""How the sensor stands changes what is recorded, not how the person moves."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from samples.noiseless import NOISELESS

from kinemimic.pipeline.files.sidecars import truth_path
from kinemimic.pipeline.kinematics.angles import ANGLES, leg_angles
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.readers.recognise import read
from kinemimic.pipeline.virtual_kinect.placement import PLACEMENTS
from kinemimic.pipeline.virtual_kinect.recorder import RADIUS, record_virtual


@pytest.fixture(scope="module", params=list(PLACEMENTS))
def recorded(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Path]:
    folder = tmp_path_factory.mktemp(request.param)
    return request.param, record_virtual(folder, sensor=request.param, levels=NOISELESS).skl


def test_joint_angles_do_not_depend_on_the_sensor(recorded: tuple[str, Path]) -> None:
    _, path = recorded
    table, (positions, _) = pq.read_table(truth_path(path)), to_nodes(read(path))
    seen = leg_angles(positions)
    for name in ANGLES:
        error = np.degrees(seen[name] - table[name].to_numpy())
        assert np.sqrt(np.mean(error**2)) < 0.01


def test_positions_are_those_of_the_placement(recorded: tuple[str, Path]) -> None:
    sensor, path = recorded
    table, (positions, _) = pq.read_table(truth_path(path)), to_nodes(read(path))
    x, y = table["x"].to_numpy(), table["y"].to_numpy()
    hips, feet = positions[:, N["hip_center"]], positions[:, [N["foot_left"], N["foot_right"]], 2].min(axis=1)
    if sensor == "fixed":
        np.testing.assert_allclose(hips[:, :2], np.stack([x, y], axis=-1), atol=1e-9)
        assert np.abs(feet).max() < 0.1
    elif sensor == "turning":
        # On a half circle each way; before the sensor all the time.
        np.testing.assert_allclose(np.hypot(x, y), RADIUS, atol=0.8)
        np.testing.assert_allclose(hips[:, 0], np.hypot(x, y), atol=0.05)
        assert np.abs(hips[:, 1]).max() < 0.3 and np.ptp(y) > 4.0
    else:
        # The floor rises with the distance by the tangent of the error, and is at another height.
        slope, height = np.polyfit(hips[:, 0], feet, 1)
        assert abs(np.degrees(np.arctan(slope))) > 3.0 and abs(height + 2.7 * slope) > 0.05


def test_the_recorded_floor_plane_is_the_one_that_the_joints_are_above() -> None:
    camera_plane = PLACEMENTS["fixed"].floor_plane
    np.testing.assert_allclose(camera_plane, PLACEMENTS["fixed"].camera.floor_plane, atol=1e-12)
    tilted = PLACEMENTS["tilted"]
    plane = tilted.floor_plane
    assert np.linalg.norm(plane[:3]) == pytest.approx(1.0)
    # A point of the room, in the sensor's X left, Y up, Z forward, is as high above the plane as recorded.
    point = np.array([2.5, 0.4, 1.1])
    camera = tilted.camera
    c, s = np.cos(camera.tilt), np.sin(camera.tilt)
    x, y, z = point - camera.position
    seen = np.array([y, s * x + c * z, c * x - s * z])
    assert plane[:3] @ seen + plane[3] == pytest.approx(tilted.recorded(point)[2])
    assert not PLACEMENTS["no-floor"].floor_plane.any()
    np.testing.assert_allclose(
        PLACEMENTS["no-floor"].recorded(PLACEMENTS["no-floor"].camera.position), np.zeros(3), atol=1e-12
    )
