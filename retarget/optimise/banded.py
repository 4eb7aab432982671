"""Block-banded normal equations of least squares over a whole clip.

Every frame has a dense block; frames one and two apart are coupled by second differences alone, with the same
number for each unknown. A cyclic clip is coupled across its seam too.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve, solveh_banded

from kinemimic.pipeline.arrays import Array

COUPLED_FRAMES = 2  # frames that a second difference couples
MIN_CYCLE_FRAMES = 2 * COUPLED_FRAMES + 2  # in a shorter cycle a frame would be coupled with itself


def second_differences(values: Array, *, cyclic: bool) -> Array:
    """x[t - 1] - 2 x[t] + x[t + 1] of values (T, K), zero at both ends unless `cyclic`."""
    out = np.zeros_like(values)
    if cyclic:
        return np.asarray(np.roll(values, 1, axis=0) - 2.0 * values + np.roll(values, -1, axis=0))
    out[1:-1] = values[:-2] - 2.0 * values[1:-1] + values[2:]
    return out


def adjoint(values: Array, *, cyclic: bool) -> Array:
    """The transpose of `second_differences` applied to values (T, K)."""
    if cyclic:
        return second_differences(values, cyclic=True)
    out = np.zeros_like(values)
    inner = values[1:-1]
    out[:-2] += inner
    out[1:-1] -= 2.0 * inner
    out[2:] += inner
    return out


def coupling(frames: int, *, cyclic: bool) -> tuple[Array, Array, Array]:
    """Diagonals (T,) of D'D for second differences D: the main one, and those of frames one and two apart.

    The last entries of the off-diagonals, across the seam, are zero unless `cyclic`.
    """
    if cyclic:
        return np.full(frames, 6.0), np.full(frames, -4.0), np.ones(frames)
    own, next_one, next_two = np.zeros(frames), np.zeros(frames), np.zeros(frames)
    own[:-2] += 1.0
    own[1:-1] += 4.0
    own[2:] += 1.0
    next_one[:-2] -= 2.0
    next_one[1:-1] -= 2.0
    next_two[:-2] = 1.0
    return own, next_one, next_two


def solve_blocks(blocks: Array, stiffness: Array, right: Array, *, cyclic: bool) -> Array:
    """Solve (blocks + D'D ⊗ diag(stiffness)) x = right for x (T, n).

    blocks: (T, n, n) symmetric; stiffness: (n,); right: (T, n). The matrix must be positive definite. Banded
    Cholesky factorisation, linear in T. A cycle's last two frames are eliminated by a Schur complement; the
    others are banded. Raises ValueError for cycles of fewer than MIN_CYCLE_FRAMES frames.
    """
    frames, n = right.shape
    own, next_one, next_two = coupling(frames, cyclic=cyclic)
    full = blocks.copy()
    at = np.arange(n)
    full[:, at, at] += own[:, None] * stiffness
    if not cyclic:
        band = _banded(full, next_one, next_two, stiffness)
        solution = solveh_banded(band, right.ravel(), lower=True, overwrite_ab=True, check_finite=False)
        return np.asarray(solution).reshape(frames, n)
    if frames < MIN_CYCLE_FRAMES:
        raise ValueError(f"expected a cycle of at least {MIN_CYCLE_FRAMES} frames")
    inner = frames - COUPLED_FRAMES
    band = _banded(full[:inner], next_one[: inner - 1], next_two[: inner - 2], stiffness)
    border = np.zeros((inner, n, COUPLED_FRAMES, n))
    corner = np.zeros((COUPLED_FRAMES, n, COUPLED_FRAMES, n))
    for k in range(COUPLED_FRAMES):
        corner[k][:, k] = full[inner + k]
    corner[0, at, 1, at] = corner[1, at, 0, at] = next_one[inner] * stiffness
    for k, frame in enumerate((inner, inner + 1)):
        for step, values in ((1, next_one), (2, next_two)):
            pairs = ((frame - step, values[frame - step]), (frame + step - frames, values[frame]))
            for other, value in pairs:
                if 0 <= other < inner:
                    border[other, at, k, at] += value * stiffness
    wide = border.reshape(inner * n, COUPLED_FRAMES * n)
    both = np.column_stack([right[:inner].ravel(), wide])
    solved = solveh_banded(band, both, lower=True, overwrite_ab=True, check_finite=False)
    last = solve(
        corner.reshape(COUPLED_FRAMES * n, COUPLED_FRAMES * n) - wide.T @ solved[:, 1:],
        right[inner:].ravel() - wide.T @ solved[:, 0],
        assume_a="pos",
    )
    first = solved[:, 0] - solved[:, 1:] @ last
    return np.concatenate([first, last]).reshape(frames, n)


def _banded(full: Array, next_one: Array, next_two: Array, stiffness: Array) -> Array:
    """LAPACK's lower band storage (2 n + 1, T n) of diagonal blocks (T, n, n) and diagonal couplings."""
    frames, n, _ = full.shape
    band = np.zeros((COUPLED_FRAMES * n + 1, frames, n))
    for column in range(n):
        band[: n - column, :, column] = full[:, column:, column].T
    for step, values in ((1, next_one), (2, next_two)):
        band[step * n, : frames - step] = values[: frames - step, None] * stiffness
    return band.reshape(COUPLED_FRAMES * n + 1, frames * n)
