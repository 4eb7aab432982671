"""Clinical angles at postures whose angles are known by construction."""

from __future__ import annotations

import numpy as np
import pytest
from samples.mirror import MIRROR
from samples.motion import walk

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.angles import (
    ANGLES,
    anatomical_knee,
    hip_flexion,
    knee_flexion,
    leg_angles,
)
from kinemimic.pipeline.kinematics.rotations import from_axis_angle, multiply, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODES

Leg = tuple[float, float, float]


def posture(hip: float, knee: float, heading: float = 0.0) -> Array:
    """Nodes (1, 20, 3) of a person who flexes both legs by these angles and looks along `heading`."""
    return rotate(from_axis_angle("Z", heading), figure((hip, knee, 0.0), (hip, knee, 0.0)))


def figure(left: Leg, right: Leg) -> Array:
    """Nodes (1, 20, 3) of a person along X whose legs are flexed at hip and knee, and then as a whole turned
    outward about the hip's sagittal axis, by these angles."""
    place = {"hip_center": (0, 0, 1.0), "spine": (0, 0, 1.1), "shoulder_center": (0, 0, 1.5)}
    p = np.zeros((len(NODES), 3))
    for name, xyz in place.items():
        p[NODE_INDEX[name]] = xyz
    for side, y, (hip, knee, out) in (("left", 0.1, left), ("right", -0.1, right)):
        aside = from_axis_angle("X", out if y > 0.0 else -out)
        thigh = 0.4 * np.array([np.sin(hip), 0, -np.cos(hip)])
        # The shank turns backward by the knee's flexion from the thigh's direction.
        shank = 0.4 * np.array([np.sin(hip - knee), 0, -np.cos(hip - knee)])
        p[NODE_INDEX[f"hip_{side}"]] = (0, y, 0.95)
        p[NODE_INDEX[f"knee_{side}"]] = p[NODE_INDEX[f"hip_{side}"]] + rotate(aside, thigh)
        p[NODE_INDEX[f"ankle_{side}"]] = p[NODE_INDEX[f"knee_{side}"]] + rotate(aside, shank)
    return p[None]


@pytest.mark.parametrize("heading", [0.0, 1.0, -2.5])
@pytest.mark.parametrize(("hip", "knee"), [(0, 0), (30, 60), (-20, 5), (90, 120), (10, -8), (0, 179)])
def test_known_posture(hip: float, knee: float, heading: float) -> None:
    curves = leg_angles(posture(np.radians(hip), np.radians(knee), heading))
    assert tuple(curves) == ANGLES
    for side in ("left", "right"):
        assert np.degrees(curves[f"knee_{side}"][0]) == pytest.approx(knee, abs=1e-6)
        assert np.degrees(curves[f"hip_{side}"][0]) == pytest.approx(hip, abs=1e-9)


@pytest.mark.parametrize("out", [-10.0, 0.0, 20.0, 45.0])
@pytest.mark.parametrize("hip", [-20.0, 0.0, 30.0])
def test_the_hip_angle_is_that_of_the_thighs_shadow_on_the_sagittal_plane(hip: float, out: float) -> None:
    """Flexed by f and abducted by a, the thigh points along (sin f, ±cos f sin a, -cos f cos a): in the plane
    y = 0 it stands at atan(tan f / cos a), 31.57° for 30° and 20°, and 0 for pure abduction."""
    curves = leg_angles(figure(tuple(np.radians([hip, 40.0, out])), tuple(np.radians([0.0, 5.0, out]))))
    shadow = np.degrees(np.arctan(np.tan(np.radians(hip)) / np.cos(np.radians(out))))
    if (hip, out) == (30.0, 20.0):
        assert shadow == pytest.approx(31.57, abs=0.005)
    found = {name: float(np.degrees(curve[0])) for name, curve in curves.items()}
    assert found == pytest.approx(
        {"knee_left": 40.0, "knee_right": 5.0, "hip_left": shadow, "hip_right": 0.0}, abs=1e-6
    )


def test_the_mirror_image_has_the_curves_of_the_other_side() -> None:
    shown = figure((0.5, 0.9, 0.35), (-0.2, 0.3, 0.1))
    image = shown[:, MIRROR] * [1.0, -1.0, 1.0]
    was, found = leg_angles(shown), leg_angles(image)
    for joint in ("knee", "hip"):
        assert abs(was[f"{joint}_left"] - was[f"{joint}_right"])[0] > 0.5
        np.testing.assert_allclose(found[f"{joint}_left"], was[f"{joint}_right"], atol=1e-12)
        np.testing.assert_allclose(found[f"{joint}_right"], was[f"{joint}_left"], atol=1e-12)


def test_angles_do_not_depend_on_where_the_figure_stands() -> None:
    p = posture(0.4, 0.9)
    tilt = multiply(from_axis_angle("X", 0.5), from_axis_angle("Y", -0.7))
    moved = rotate(tilt, p) + np.array([3.0, -2.0, 0.5])
    for name, curve in leg_angles(p).items():
        assert np.allclose(leg_angles(moved)[name], curve, atol=1e-12)


def test_a_given_pelvis_frame_is_used() -> None:
    p = posture(0.4, 0.9)
    leaning = from_axis_angle("Y", np.array([0.25]))  # the pelvis tips forward: the thigh is nearer its front
    assert leg_angles(p, leaning)["hip_left"][0] == pytest.approx(0.4 + 0.25)


def test_missing_joints_give_nan_and_nothing_else() -> None:
    p = np.concatenate([posture(0.4, 0.9)] * 3)
    p[1, NODE_INDEX["knee_left"]] = np.nan
    p[2, NODE_INDEX["spine"]] = np.nan
    curves = leg_angles(p)
    assert np.array_equal(np.isnan(curves["knee_left"]), [False, True, False])
    assert np.array_equal(np.isnan(curves["hip_left"]), [False, True, True])
    assert np.array_equal(np.isnan(curves["knee_right"]), [False, False, False])


def test_definitions_by_hand() -> None:
    lateral = np.array([0.0, 1.0, 0.0])
    hip, knee = np.array([0.0, 0, 2]), np.array([0.0, 0, 1])
    assert knee_flexion(hip, knee, np.array([-1.0, 0, 1]), lateral) == pytest.approx(np.pi / 2)
    assert knee_flexion(hip, knee, np.array([1.0, 0, 1]), lateral) == pytest.approx(-np.pi / 2)
    assert hip_flexion(np.array([0, 0, 0, 1.0]), hip, np.array([1.0, 0, 1])) == pytest.approx(np.pi / 4)


@pytest.mark.parametrize(
    ("shown", "meant"),
    [
        ([20, 8, 2, -4, -9, -14, -6, 3], [20, 8, 2, -4, -9, -14, -6, 3]),  # through straight, not too far
        ([9, -6, -16, -30, -12, 5, -3], [9, 6, 16, 30, 12, 5, -3]),  # too far: the whole run, and it alone
        ([13, -12, -9, 2], [13, 12, 9, 2]),  # leaps in
        ([2, -9, -12, 13], [2, 9, 12, 13]),  # leaps out
        ([50, 20, 40, -2], [50, 20, 40, 2]),
        ([5, np.nan, -3, np.nan, -40], [5, np.nan, -3, np.nan, 40]),
        ([], []),
    ],
)
def test_a_knee_bends_to_the_front_a_little_and_only_through_straight(
    shown: list[float], meant: list[float]
) -> None:
    found = anatomical_knee(np.radians(np.array(shown, dtype=np.float64)))
    np.testing.assert_array_equal(found, np.radians(np.array(meant, dtype=np.float64)))


@pytest.mark.parametrize("rate", [10.0, 15.0, 30.0, 60.0, 120.0])
def test_the_rate_of_a_steady_sensor_does_not_change_the_sign_of_a_knee(rate: float) -> None:
    """A swing of 500 degrees a second out of hyperextension: 17 degrees between frames at 30 Hz."""
    times = np.arange(round(2.0 * rate) + 1) / rate
    knee = np.radians(25.0 - 35.0 * np.cos(2.0 * np.pi * times / 0.44))
    assert knee.min() < np.radians(-9.0)
    np.testing.assert_array_equal(anatomical_knee(knee, times, steady=True), knee)


def test_a_noisy_knee_leaps_by_its_speed() -> None:
    """15 degrees between the frames of a Kinect, or over the longer time of a slower sensor."""
    leaping = np.radians([2.0, -8.0, 9.0])
    for step, meant in ((1 / 30, [2.0, 8.0, 9.0]), (1 / 120, [2.0, 8.0, 9.0]), (1 / 15, [2.0, -8.0, 9.0])):
        found = anatomical_knee(leaping, step * np.arange(3))
        np.testing.assert_allclose(np.degrees(found), meant, atol=1e-9)


@pytest.mark.parametrize("wrong", [70.0, 120.0, 180.0])
def test_a_pelvis_that_looks_the_wrong_way_does_not_turn_the_knees_over(wrong: float) -> None:
    shown = walk(120)
    # Turned in every third second, as where a sensor exchanges the hips.
    heading = np.where(shown.times % 3.0 < 1.0, np.radians(wrong), 0.0)
    found = leg_angles(shown.joints, from_axis_angle("Z", heading))
    for side in ("left", "right"):
        np.testing.assert_allclose(found[f"knee_{side}"], shown.angles[f"knee_{side}"], atol=1e-6)
