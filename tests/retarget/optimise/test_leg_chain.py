"""Root and legs: points against forward kinematics, Jacobians against finite differences."""

from __future__ import annotations

import numpy as np
import pytest

from kinemimic.pipeline.kinematics.rotations import from_axis_angle, from_rotvec, multiply
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.retarget.feet.contact import sole_positions
from kinemimic.retarget.feet.scale import body_kinematics
from kinemimic.retarget.optimise.leg_chain import (
    LEG_COLUMNS,
    UNKNOWNS,
    leg_chain,
    leg_jacobian,
    leg_points,
    normal_equations,
)

FRAMES = 12


@pytest.fixture
def case():
    rng = np.random.default_rng(0)
    root, rotations = rng.standard_normal((FRAMES, 3)), from_rotvec(rng.uniform(-0.6, 0.6, (FRAMES, 20, 3)))
    return root, rotations, rng.uniform(-0.4, 0.4, (FRAMES, UNKNOWNS))


def corrected(root, rotations, x):
    """The corrections as documented, on quaternions."""
    rotations = rotations.copy()
    rotations[:, 0] = multiply(rotations[:, 0], from_rotvec(x[:, 3:6]))
    for side, hip, knee, ankle in zip(SIDES, (6, 13), (9, 16), (10, 17), strict=True):
        for joint, turn in (
            ("hip", from_rotvec(x[:, hip : hip + 3])),
            ("knee", from_axis_angle("Y", x[:, knee])),
            ("ankle", from_rotvec(x[:, ankle : ankle + 3])),
        ):
            node = N[f"{joint}_{side}"]
            rotations[:, node] = multiply(rotations[:, node], turn)
    return body_kinematics(rotations, root + x[:, :3])


def test_points_are_those_of_the_corrected_humanoid(case):
    root, rotations, x = case
    positions, frames = corrected(root, rotations, x)
    points = leg_points(leg_chain(root, rotations), x)
    for k, side in enumerate(SIDES):
        assert points[:, k, 0] == pytest.approx(positions[:, N[f"knee_{side}"]])
        assert points[:, k, 1] == pytest.approx(positions[:, N[f"ankle_{side}"]])
    assert points[:, :, 2:] == pytest.approx(sole_positions(positions, frames))


def differences(chain, x):
    """(T, 2, 6, 3, 20) by central differences."""
    step = 1e-6
    return np.stack(
        [
            (leg_points(chain, x + step * e) - leg_points(chain, x - step * e)) / (2 * step)
            for e in np.eye(UNKNOWNS)
        ],
        axis=-1,
    )


def test_jacobian_is_the_derivative(case):
    root, rotations, x = case
    chain = leg_chain(root, rotations)
    expected, (_, found) = differences(chain, x), leg_jacobian(chain, x)
    for k, leg in enumerate(LEG_COLUMNS):
        own = [*range(6), *range(leg.start, leg.stop)]
        assert found[:, k] == pytest.approx(expected[:, k][..., own], abs=1e-7)
        # One leg's joints do not move the other.
        assert not np.delete(expected[:, k], own, axis=-1).any()


def test_normal_equations_are_those_of_all_rows(case):
    root, rotations, x = case
    chain = leg_chain(root, rotations)
    rng = np.random.default_rng(1)
    residual, weights = rng.standard_normal((FRAMES, 2, 6, 3)), rng.random((FRAMES, 2, 6, 3))
    rows = differences(chain, x).reshape(FRAMES, 36, UNKNOWNS)
    w, r = weights.reshape(FRAMES, 36), residual.reshape(FRAMES, 36)
    square, right = normal_equations(leg_jacobian(chain, x)[1], residual, weights)
    assert square == pytest.approx(np.einsum("tri,tr,trj->tij", rows, w, rows), abs=1e-6)
    assert right == pytest.approx(np.einsum("tri,tr,tr->ti", rows, w, r), abs=1e-6)
