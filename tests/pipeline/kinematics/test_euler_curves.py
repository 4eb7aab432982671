"""Euler angles as curves: the same rotations, and no jumps where a joint bends by more than a right angle."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest

from kinemimic.pipeline.kinematics.euler_curves import euler_curves, principal_angles
from kinemimic.pipeline.kinematics.rotations import angle_between, from_euler

ORDERS = ["".join(order) for order in permutations("XYZ")]
CLOCK = np.linspace(0.0, 2.0 * np.pi, 200)


@pytest.mark.parametrize("order", ORDERS)
def test_a_bend_beyond_a_right_angle_stays_one_curve(order: str) -> None:
    angles = np.stack([0.2 * np.sin(CLOCK), 1.2 - 1.0 * np.cos(CLOCK), 0.1 * np.cos(CLOCK)], axis=1)
    found = euler_curves(from_euler(angles, order), order)
    assert np.abs(found - angles).max() < 1e-9
    assert np.abs(np.diff(principal_angles(from_euler(angles, order), order), axis=0)).max() > 3.0


def test_a_motion_that_begins_bent_is_described_from_zero() -> None:
    angles = np.stack([0.0 * CLOCK, 1.9 + 0.1 * np.sin(CLOCK), 0.0 * CLOCK], axis=1)
    assert np.abs(euler_curves(from_euler(angles, "XYZ"), "XYZ") - angles).max() < 1e-9


def test_somebody_who_turns_twice_has_a_curve_of_two_turns() -> None:
    angles = np.stack([0.1 * np.sin(CLOCK), 0.1 * np.cos(CLOCK), 2.0 * CLOCK], axis=1)
    found = euler_curves(from_euler(angles, "ZXY"), "ZXY")
    assert np.ptp(found[:, 2]) == pytest.approx(4.0 * np.pi)
    assert np.abs(np.diff(found, axis=0)).max() < 0.1


@pytest.mark.parametrize("order", ORDERS)
def test_the_rotations_are_the_same_through_a_gimbal_lock(order: str) -> None:
    angles = np.stack([0.3 * np.sin(CLOCK), np.linspace(0.0, np.pi, 200), 0.3 * np.cos(CLOCK)], axis=1)
    angles[100, 1] = 0.5 * np.pi
    rotations = from_euler(angles, order)
    assert angle_between(from_euler(euler_curves(rotations, order), order), rotations).max() < 1e-7
    assert euler_curves(rotations[:1], order).shape == (1, 3)
