"""The exponential map of rotation vectors as matrices, with its right Jacobian."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array


def exponential(v: Array) -> tuple[Array, Array]:
    """Rotation matrices exp(v) and their right Jacobians, both (..., 3, 3), of rotation vectors v (..., 3).

    exp(v + d) = exp(v) exp(J d) to first order: exp(v) = 1 + a K + b K² and J = 1 - b K + c K² with K = [v]×,
    θ = |v|, a = sin θ / θ, b = (1 - cos θ) / θ², c = (θ - sin θ) / θ³ (Chirikjian 2011, eq. 10.86).
    """
    square = np.einsum("...i,...i->...", v, v)
    # Series below 0.1 rad, where the closed forms lose digits; its truncation error is 1e-11.
    near = square < 1e-2
    theta = np.sqrt(np.where(near, 1.0, square))
    sine = np.sin(theta)
    a = np.where(near, 1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0)), sine / theta)
    b = np.where(
        near,
        0.5 - square / 24.0 * (1.0 - square / 30.0 * (1.0 - square / 56.0)),
        (1.0 - np.cos(theta)) / theta**2,
    )
    c = np.where(
        near,
        1.0 / 6.0 - square / 120.0 * (1.0 - square / 42.0 * (1.0 - square / 72.0)),
        (theta - sine) / theta**3,
    )
    cross = hat(v)
    # K² = v v' - θ² 1
    squared = v[..., :, None] * v[..., None, :]
    at = np.arange(3)
    squared[..., at, at] -= square[..., None]
    turn = a[..., None, None] * cross + b[..., None, None] * squared
    jacobian = c[..., None, None] * squared - b[..., None, None] * cross
    turn[..., at, at] += 1.0
    jacobian[..., at, at] += 1.0
    return turn, jacobian


def hat(v: Array) -> Array:
    """Matrices (..., 3, 3) with hat(v) u = v × u."""
    out = np.zeros((*v.shape, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = v[..., 2], -v[..., 1], v[..., 0]
    return out
