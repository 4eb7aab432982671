from __future__ import annotations

import numpy as np
import pytest

from kinemimic.train.tracker.clip_sampling import FLOOR, RATE, draw_weights, update_failures


def test_weights_follow_the_failures_above_a_floor() -> None:
    weights = draw_weights(np.array([1.0, 0.0, 0.5, 0.5]))
    assert weights.sum() == pytest.approx(1.0)
    assert weights[1] == pytest.approx(FLOOR / 4)
    assert weights[0] - weights[1] == pytest.approx(2.0 * (weights[2] - weights[1]))


def test_without_failures_all_motions_are_alike() -> None:
    np.testing.assert_allclose(draw_weights(np.zeros(5)), 0.2)


def test_failures_are_moving_means() -> None:
    failures = np.array([1.0, 0.0])
    update_failures(failures, [(0, False), (1, True), (0, False)])
    np.testing.assert_allclose(failures, [(1.0 - RATE) ** 2, RATE])
