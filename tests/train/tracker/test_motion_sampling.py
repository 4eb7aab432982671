from __future__ import annotations

import numpy as np
import pytest

from kinemimic.train.tracker.motion_sampling import FLOOR, RATE, MotionStatistics, Outcome


def statistics(failures: list[float], lengths: list[float]) -> MotionStatistics:
    found = MotionStatistics(len(failures), 1.0)
    found.failures, found.lengths = np.array(failures), np.array(lengths)
    return found


def test_what_can_be_learned_is_drawn_most_and_the_rest_has_a_floor() -> None:
    weights = statistics([1.0, 0.0, 0.5, 0.1], [10.0] * 4).weights()
    assert weights.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(weights[:2], FLOOR / 4)
    assert weights[3] - FLOOR / 4 == pytest.approx(0.36 * (weights[2] - FLOOR / 4))


def test_samples_not_episodes_follow_what_can_be_learned() -> None:
    found = statistics([0.8, 0.2, 0.5], [20.0, 200.0, 100.0])
    samples = (found.weights() - FLOOR / 3) * found.lengths
    np.testing.assert_allclose(samples / samples[0], [1.0, 1.0, 0.25 / 0.16])


@pytest.mark.parametrize("failures", [0.0, 1.0])
def test_motions_that_all_fail_or_all_succeed_are_alike(failures: float) -> None:
    np.testing.assert_allclose(statistics([failures] * 5, [3.0, 1.0, 2.0, 4.0, 5.0]).weights(), 0.2)


def test_a_motion_that_was_never_tried_is_drawn_as_often_as_any() -> None:
    found = MotionStatistics(4, 100.0)
    found.update([Outcome(0, False, 100), Outcome(1, True, 100)])
    weights = found.weights()
    assert weights[2] == weights[3] == weights.max()


def test_failures_and_lengths_are_moving_means() -> None:
    found = MotionStatistics(2, 100.0)
    found.update([Outcome(0, False, 300), Outcome(1, True, 20), Outcome(0, False, 300)])
    np.testing.assert_allclose(found.failures, [0.5 * (1.0 - RATE) ** 2, 1.0 - 0.5 * (1.0 - RATE)])
    np.testing.assert_allclose(found.lengths, [300.0 - 200.0 * (1.0 - RATE) ** 2, 100.0 - 80.0 * RATE])
