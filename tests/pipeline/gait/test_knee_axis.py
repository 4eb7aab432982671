"""Knees composed of known rotations: flexion, and a known swing of the axis."""

from __future__ import annotations

import numpy as np
import pytest

from kinemimic.pipeline.gait.knee_axis import off_axis, off_axis_of_fitted_hinge
from kinemimic.pipeline.kinematics.rotations import conjugate, from_axis_angle, from_rotvec, multiply

TURN = np.linspace(0, 2 * np.pi, 80, endpoint=False)
FLEXION = np.radians(30 - 30 * np.cos(TURN))


def test_a_hinge_has_none() -> None:
    assert np.allclose(off_axis(from_axis_angle("Y", FLEXION)), 0.0, atol=1e-12)
    own = off_axis_of_fitted_hinge(from_axis_angle("Y", FLEXION))
    assert own is not None and np.allclose(own, 0.0, atol=1e-7)


@pytest.mark.parametrize("degrees", [1.0, 7.0, 40.0])
@pytest.mark.parametrize("direction", [0.0, 0.8, 2.0])
def test_the_swing_of_the_axis_comes_out_whatever_the_flexion(degrees: float, direction: float) -> None:
    # About any axis at right angles to the hinge: abduction (X), inward rotation (Z), or both.
    swing = from_rotvec(np.radians(degrees) * np.array([np.cos(direction), 0.0, np.sin(direction)]))
    assert np.degrees(off_axis(multiply(swing, from_axis_angle("Y", FLEXION)))) == pytest.approx(degrees)


def test_the_sign_of_a_quaternion_does_not_matter() -> None:
    knee = multiply(from_axis_angle("X", 0.1), from_axis_angle("Y", FLEXION))
    assert np.allclose(off_axis(-knee), off_axis(knee))


def test_the_files_own_axes_and_rest_pose_do_not_matter() -> None:
    wobble = from_axis_angle("X", np.radians(6.0) * np.sin(3 * TURN))
    knee = multiply(wobble, from_axis_angle("Y", FLEXION))
    axes, rest = from_rotvec(np.array([0.4, -1.1, 0.7])), from_rotvec(np.array([-0.2, 0.3, 1.4]))
    strange = multiply(multiply(conjugate(axes), multiply(knee, axes)), rest)
    plain, turned = off_axis_of_fitted_hinge(knee), off_axis_of_fitted_hinge(strange)
    assert plain is not None and turned is not None
    # Wobble about a hinge found from the data: its rms of 6°/√2 = 4.2°, less what the fit takes as hinge.
    assert np.degrees(np.sqrt(np.mean(plain**2))) == pytest.approx(4.2, abs=0.3)
    assert np.allclose(turned, plain, atol=np.radians(1.0))


def test_a_knee_that_does_not_bend_shows_no_axis_and_missing_frames_stay_missing() -> None:
    assert off_axis_of_fitted_hinge(from_axis_angle("Y", 0.01 * np.sin(TURN))) is None
    knee = from_axis_angle("Y", FLEXION)
    knee[5:9] = np.nan
    own = off_axis_of_fitted_hinge(knee)
    assert own is not None
    assert np.isnan(own[5:9]).all() and np.isfinite(np.delete(own, range(5, 9))).all()
    assert off_axis_of_fitted_hinge(np.full((80, 4), np.nan)) is None
