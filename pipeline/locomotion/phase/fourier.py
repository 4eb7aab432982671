"""Weighted ridge fits of Fourier series in a phase: smooth, average and close a loop in one step."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array


def design(phase: Array, harmonics: int, derivative: int = 0) -> Array:
    """Columns 1, cos kφ, sin kφ for k = 1..harmonics at phases (N,) in cycles: (N, 1 + 2 harmonics).

    derivative: 0, or 1 for the derivative with respect to the phase.
    """
    k = np.arange(1, harmonics + 1)
    angle = 2.0 * np.pi * np.asarray(phase)[:, None] * k
    if derivative == 0:
        return np.concatenate([np.ones((len(angle), 1)), np.cos(angle), np.sin(angle)], axis=1)
    speed = 2.0 * np.pi * k
    return np.concatenate([np.zeros((len(angle), 1)), -speed * np.sin(angle), speed * np.cos(angle)], axis=1)


def fit(
    phase: Array, values: Array, harmonics: int, *, weights: Array | None = None, ridge: float = 1e-6
) -> Array:
    """Coefficients (1 + 2 harmonics, ...) of values (N, ...) at phases (N,) in cycles.

    weights: (N,) of each sample; ridge: penalty on the k-th harmonic, times k⁴ and the sum of the weights,
    so that few samples give a smooth loop.
    """
    w = np.ones(len(values)) if weights is None else np.asarray(weights, dtype=np.float64)
    return solve(design(phase, harmonics), values, w, ridge)


def solve(x: Array, values: Array, w: Array, ridge: float) -> Array:
    """`fit` for a given x = design(phase, harmonics), for many fits with different weights w (N,)."""
    values = np.asarray(values, dtype=np.float64)
    flat = values.reshape(len(values), -1)
    k = np.arange(1, x.shape[1] // 2 + 1, dtype=np.float64)
    penalty = np.concatenate([[0.0], k**4, k**4]) * ridge * w.sum()
    coefficients: Array = np.linalg.solve(
        x.T @ (w[:, None] * x) + np.diag(penalty), x.T @ (w[:, None] * flat)
    ).astype(np.float64)
    return coefficients.reshape(-1, *values.shape[1:])


def evaluate(coefficients: Array, phase: Array, derivative: int = 0) -> Array:
    """Values (N, ...) of a series at phases (N,) in cycles, or their derivative with respect to the phase."""
    harmonics = (len(coefficients) - 1) // 2
    return np.tensordot(design(phase, harmonics, derivative), coefficients, axes=(1, 0))
