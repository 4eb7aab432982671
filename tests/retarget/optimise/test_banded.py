"""The banded solver against dense matrices."""

from __future__ import annotations

import numpy as np
import pytest

from kinemimic.retarget.optimise.banded import MIN_CYCLE_FRAMES, adjoint, second_differences, solve_blocks


@pytest.mark.parametrize("cyclic", [False, True])
@pytest.mark.parametrize(("frames", "n"), [(MIN_CYCLE_FRAMES, 2), (7, 3), (40, 4)])
def test_banded_and_dense_solutions_are_equal(frames, n, cyclic):
    rng = np.random.default_rng(frames)
    root = rng.standard_normal((frames, n, n))
    blocks = root @ root.transpose(0, 2, 1) + 0.1 * np.eye(n)
    stiffness, right = rng.uniform(0.0, 50.0, n), rng.standard_normal((frames, n))
    differences = second_differences(np.eye(frames), cyclic=cyclic)
    dense = np.kron(differences.T @ differences, np.diag(stiffness))
    for t in range(frames):
        dense[t * n : (t + 1) * n, t * n : (t + 1) * n] += blocks[t]
    expected = np.linalg.solve(dense, right.ravel()).reshape(frames, n)
    assert solve_blocks(blocks, stiffness, right, cyclic=cyclic) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("cyclic", [False, True])
def test_adjoint_is_the_transpose(cyclic):
    rng = np.random.default_rng(0)
    x, y = rng.standard_normal((2, 9, 3))
    there = (second_differences(x, cyclic=cyclic) * y).sum()
    assert there == pytest.approx((x * adjoint(y, cyclic=cyclic)).sum())


def test_a_straight_line_has_second_differences_only_at_a_cycles_seam():
    line = np.arange(8.0)[:, None]
    assert not second_differences(line, cyclic=False).any()
    assert np.flatnonzero(second_differences(line, cyclic=True)).tolist() == [0, 7]


def test_a_cycle_too_short_for_the_coupling_is_refused():
    with pytest.raises(ValueError, match="at least 6"):
        solve_blocks(np.tile(np.eye(2), (5, 1, 1)), np.ones(2), np.ones((5, 2)), cyclic=True)
