"""A step through the bands is the step of the dense least-squares problem."""

from __future__ import annotations

import numpy as np
import pytest

from kinemimic.pipeline.body_fit.normal_equations import NormalEquations

T, K, G, R = 7, 4, 3, 5


@pytest.mark.parametrize("frames_only", [False, True])
def test_the_step_is_that_of_the_dense_problem(frames_only: bool) -> None:
    rng = np.random.default_rng(0)
    residual, by, shared = rng.normal(size=(T, R)), rng.normal(size=(T, R, K)), rng.normal(size=(T, R, G))
    values, weights = rng.normal(size=(T, 2)), rng.uniform(0.5, 2.0, (T - 1, 2))
    by_values = rng.normal(size=(T, 2, K))
    bends, stiff = rng.normal(size=(T - 2, K)), rng.uniform(0.5, 2.0, (T - 2, K))
    own, by_own = rng.normal(size=2), rng.normal(size=(2, G))

    equations = NormalEquations(T, K, G)
    equations.add(residual, by, shared)
    moved = weights * np.diff(values, axis=0)
    equations.add_differences(moved, by_values, weights)
    equations.add_second_differences(stiff * bends, stiff)
    equations.add_shared(own, by_own)

    rows, right = [], []

    def row(r: float) -> np.ndarray:
        rows.append(np.zeros(T * K + G))
        right.append(r)
        return rows[-1]

    for t in range(T):
        for r in range(R):
            line = row(residual[t, r])
            line[t * K : (t + 1) * K], line[T * K :] = by[t, r], shared[t, r]
    for t in range(T - 1):
        for r in range(2):
            line = row(moved[t, r])
            line[t * K : (t + 1) * K] = -weights[t, r] * by_values[t, r]
            line[(t + 1) * K : (t + 2) * K] = weights[t, r] * by_values[t + 1, r]
    for t in range(1, T - 1):
        for k in range(K):
            line = row(stiff[t - 1, k] * bends[t - 1, k])
            for offset, factor in ((-1, 1.0), (0, -2.0), (1, 1.0)):
                line[(t + offset) * K + k] = factor * stiff[t - 1, k]
    for r in range(2):
        row(own[r])[T * K :] = by_own[r]
    J, b = np.array(rows), np.array(right)
    if frames_only:
        J = J[:, : T * K]
    expected = -np.linalg.lstsq(J, b, rcond=None)[0]
    frames, common = equations.step(0.0, frames_only=frames_only)
    assert frames.ravel() == pytest.approx(expected[: T * K], abs=1e-5)
    assert common == pytest.approx(np.zeros(G) if frames_only else expected[T * K :], abs=1e-5)
    assert equations.cost == pytest.approx(float(b @ b))
