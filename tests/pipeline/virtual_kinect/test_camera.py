"""The camera: pixels computed by hand, and occlusion."""

from __future__ import annotations

import numpy as np
import pytest
from peers.straight_walk import straight_walk

from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import NODES
from kinemimic.pipeline.readers.mocap.deepmimic import read_deepmimic, stock_motion
from kinemimic.pipeline.virtual_kinect.camera import FOCAL, HEIGHT, WIDTH, Camera, occluded
from kinemimic.pipeline.virtual_kinect.subject import close_loop


def test_pixels_computed_by_hand() -> None:
    pixels, depth = Camera(height=1.0, tilt=0.0).project(np.array([[2.0, 0.0, 1.0], [2.0, 0.5, 1.2]]))
    np.testing.assert_allclose(depth, [2.0, 2.0])
    # What is to the left and above falls left of and above the image's middle.
    expected = [[WIDTH / 2, HEIGHT / 2], [WIDTH / 2 - FOCAL * 0.25, HEIGHT / 2 - FOCAL * 0.1]]
    np.testing.assert_allclose(pixels, expected)


def test_a_camera_that_looks_down_sees_the_point_on_its_axis_in_the_middle() -> None:
    camera = Camera(height=1.0, tilt=np.radians(30.0))
    pixels, depth = camera.project(np.array([[np.sqrt(3.0), 0.0, 0.0]]))
    np.testing.assert_allclose(pixels[0], [WIDTH / 2, HEIGHT / 2], atol=1e-9)
    assert depth[0] == pytest.approx(2.0)
    # The same point in the sensor's frame is (0, 0, 2) and lies on the floor.
    a, b, c, d = camera.floor_plane
    assert 2.0 * c + d == pytest.approx(0.0) and np.hypot(b, c) == pytest.approx(1.0) and a == 0.0


def _side_view(heading: float) -> tuple[np.ndarray, np.ndarray]:
    gait = close_loop(read_deepmimic(stock_motion("walk")))
    elapsed = np.linspace(0.0, gait.period, 40, endpoint=False)
    start = np.array([3.0, -0.5 * np.sin(heading) * gait.stride])
    joints = straight_walk(gait, elapsed, start=start, heading=heading, phase=0.0).joints
    return joints, occluded(Camera(), joints)


@pytest.mark.parametrize(
    ("heading", "near", "far"), [(np.pi / 2, "left", "right"), (-np.pi / 2, "right", "left")]
)
def test_from_the_side_it_is_the_far_limbs_that_are_covered(heading: float, near: str, far: str) -> None:
    joints, covered = _side_view(heading)
    # Facing +Y, the left side is towards a sensor that looks along +X.
    assert joints[:, N[f"hip_{far}"], 0].mean() > joints[:, N[f"hip_{near}"], 0].mean()
    share = dict(zip(NODES, covered.mean(axis=0), strict=True))
    assert share[f"knee_{far}"] > 0.1 and share[f"knee_{near}"] == 0.0
    assert share[f"shoulder_{far}"] > 0.5 and share[f"shoulder_{near}"] == 0.0
    assert share["hip_center"] == share[f"hip_{far}"] == 0.0


def test_from_the_front_no_leg_is_covered() -> None:
    gait = close_loop(read_deepmimic(stock_motion("walk")))
    elapsed = np.linspace(0.0, gait.period, 40, endpoint=False)
    joints = straight_walk(gait, elapsed, start=np.array([4.0, 0.0]), heading=np.pi, phase=0.0).joints
    covered = occluded(Camera(), joints)
    assert not covered[:, [N["knee_left"], N["knee_right"], N["ankle_left"], N["ankle_right"]]].any()


def test_outside_of_the_image_nothing_is_seen() -> None:
    joints, _ = _side_view(np.pi / 2)
    away = occluded(Camera(), joints + np.array([0.0, 3.0, 0.0]))
    assert away[:, N["head"]].all() and away[:, N["ankle_left"]].all()
