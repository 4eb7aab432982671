"""Normal equations of least squares over a clip: a block per frame, neighbours, unknowns of the whole clip.

The matrix is block-banded (frames one and two apart are coupled) with a border (the lengths and the camera),
so a step costs time and memory in proportion to the frames.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import cho_solve_banded, cholesky_banded, solve

from kinemimic.pipeline.arrays import Array

# Added to the diagonal, for unknowns that no residual of a frame constrains.
_REGULAR = 1e-9


class NormalEquations:
    """J'J and J'r, added up term by term, for T frames of K unknowns and G unknowns of the whole clip."""

    def __init__(self, frames: int, unknowns: int, shared: int) -> None:
        T, K, G = frames, unknowns, shared
        self.own, self.next = np.zeros((T, K, K)), np.zeros((max(T - 1, 0), K, K))
        self.second = np.zeros((T, K))  # per frame and unknown: squared weight of its second difference
        self.border, self.corner = np.zeros((T, K, G)), np.zeros((G, G))
        self.right, self.right_shared = np.zeros((T, K)), np.zeros(G)
        self.cost = 0.0

    def add(self, residual: Array, by: Array, shared: Array | None = None) -> None:
        """Residuals (T, R), already weighted, with derivatives (T, R, K) and, by the shared, (T, R, G)."""
        transposed = by.swapaxes(1, 2)
        self.own += transposed @ by
        self.right += (transposed @ residual[..., None])[..., 0]
        self.cost += float(np.sum(residual**2))
        if shared is not None:
            self.border += transposed @ shared
            self.corner += np.einsum("trg,trh->gh", shared, shared)
            self.right_shared += np.einsum("trg,tr->g", shared, residual)

    def add_differences(self, residual: Array, by: Array, weight: Array) -> None:
        """Residuals (T - 1, R) = weight (T - 1, R) * (x of the next frame - x of this one), whose x has the
        derivatives (T, R, K)."""
        late, early = weight[..., None] * by[1:], weight[..., None] * by[:-1]
        self.own[1:] += late.swapaxes(1, 2) @ late
        self.own[:-1] += early.swapaxes(1, 2) @ early
        self.next -= late.swapaxes(1, 2) @ early  # (next frame's unknowns, this frame's)
        self.right[1:] += (late.swapaxes(1, 2) @ residual[..., None])[..., 0]
        self.right[:-1] -= (early.swapaxes(1, 2) @ residual[..., None])[..., 0]
        self.cost += float(np.sum(residual**2))

    def add_second_differences(self, residual: Array, weight: Array) -> None:
        """Residuals (T - 2, K) = weight (T - 2, K) * (x[t - 1] - 2 x[t] + x[t + 1]), for t from 1."""
        self.second[1:-1] += weight**2
        pull = weight * residual
        self.right[:-2] += pull
        self.right[1:-1] -= 2.0 * pull
        self.right[2:] += pull
        self.cost += float(np.sum(residual**2))

    def add_shared(self, residual: Array, by: Array) -> None:
        """Residuals (R,) of the unknowns of the whole clip alone, with derivatives (R, G)."""
        self.corner += by.T @ by
        self.right_shared += by.T @ residual
        self.cost += float(np.sum(residual**2))

    def step(self, damping: float, *, frames_only: bool = False) -> tuple[Array, Array]:
        """The damped Gauss-Newton step: (T, K) and (G,), zero with `frames_only`.

        damping: share of the diagonal that is added to it. LinAlgError if the matrix is not positive
        definite.
        """
        T, K, G = self.border.shape
        factor = cholesky_banded(self._band(damping), overwrite_ab=True, lower=True, check_finite=False)
        border = self.border.reshape(T * K, G)[:, : 0 if frames_only else G]
        both = np.concatenate([self.right.reshape(T * K, 1), border], axis=1)
        solved = cho_solve_banded((factor, True), both, check_finite=False)
        if frames_only:
            return -solved[:, 0].reshape(T, K), np.zeros(G)
        corner = self.corner + np.diag(damping * np.diag(self.corner) + _REGULAR)
        shared = solve(
            corner - border.T @ solved[:, 1:], self.right_shared - border.T @ solved[:, 0], assume_a="sym"
        )
        frames = solved[:, 0] - solved[:, 1:] @ shared
        return -frames.reshape(T, K), -np.asarray(shared)

    def _band(self, damping: float) -> Array:
        """LAPACK's lower band storage."""
        T, K, _ = self.border.shape
        own, at = self.own.copy(), np.arange(K)
        middle = self.second
        own[:, at, at] += 4.0 * middle
        own[:-1, at, at] += middle[1:]
        own[1:, at, at] += middle[:-1]
        own[:, at, at] *= 1.0 + damping
        own[:, at, at] += _REGULAR
        band = np.zeros((2 * K + 1, T, K))
        for column in range(K):
            band[: K - column, :, column] = own[:, column:, column].T
            # Of the next frame's unknowns, row r is r + K - column below the diagonal.
            band[K - column : 2 * K - column, : T - 1, column] = self.next[:, :, column].T
        if T > 1:
            # The frame in the middle of three couples its neighbours with itself.
            band[K, : T - 1] -= 2.0 * (middle[:-1] + middle[1:])
        if T > 2:
            band[2 * K, : T - 2] += middle[1:-1]
        return band.reshape(2 * K + 1, T * K)
