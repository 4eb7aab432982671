"""The exponential map against quaternions, and its Jacobian against finite differences."""

from __future__ import annotations

import numpy as np
import pytest

from kinemimic.pipeline.kinematics.rotations import conjugate, from_rotvec, multiply, to_matrix, to_rotvec
from kinemimic.retarget.optimise.tangent import exponential, hat

VECTORS = np.random.default_rng(0).uniform(-1.5, 1.5, (60, 3)) * np.geomspace(1e-6, 1.0, 60)[:, None]


def test_the_exponential_agrees_with_quaternions():
    assert exponential(VECTORS)[0] == pytest.approx(to_matrix(from_rotvec(VECTORS)), abs=1e-12)


def test_jacobian_is_the_derivative():
    step = 1e-5
    found = np.stack(
        [
            to_rotvec(
                multiply(conjugate(from_rotvec(VECTORS - step * axis)), from_rotvec(VECTORS + step * axis))
            )
            / (2 * step)
            for axis in np.eye(3)
        ],
        axis=-1,
    )
    assert exponential(VECTORS)[1] == pytest.approx(found, abs=1e-7)


def test_hat_is_the_cross_product():
    u, v = np.random.default_rng(1).standard_normal((2, 5, 3))
    assert np.einsum("tij,tj->ti", hat(v), u) == pytest.approx(np.cross(v, u))
