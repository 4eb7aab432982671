"""A pass on an even clock."""

from __future__ import annotations

import numpy as np
import pytest

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import NODES
from kinemimic.pipeline.locomotion.even_clock import RATE, even_pass

VELOCITY = np.array([1.2, -0.3, 0.05])


def on_a_line(times: Array) -> Array:
    """Positions (T, 20, 3) of nodes that move at one velocity from places of their own."""
    start = np.random.default_rng(0).standard_normal((len(NODES), 3))
    return np.asarray(start + times[:, None, None] * VELOCITY)


@pytest.mark.parametrize("rate", [15.0, 30.0, 60.0, 120.0])
def test_a_straight_line_is_unchanged(rate: float) -> None:
    """At frames that are not even either; not so near the ends that the smoothing reaches beyond them."""
    times = 7.0 + np.arange(round(3.0 * rate)) / rate
    times[1:-1] += np.random.default_rng(1).uniform(-0.2, 0.2, len(times) - 2) / rate
    found = even_pass(times, on_a_line(times))
    assert found is not None
    np.testing.assert_allclose(np.diff(found.times), 1.0 / RATE, atol=1e-12)
    assert found.times[0] == times[0]
    assert abs(found.times[-1] - times[-1]) <= 0.5 / RATE + 1e-9
    inner = (found.times > times[0] + 3.0 / rate) & (found.times < times[-1] - 3.0 / rate)
    np.testing.assert_allclose(found.positions[inner], on_a_line(found.times)[inner], atol=1e-9)
    assert found.seen.all()


def test_a_gap_is_filled_along_the_line_and_is_not_seen() -> None:
    times = np.arange(90) / 30.0
    positions = on_a_line(times)
    positions[40:50, N["wrist_left"]] = np.nan
    found = even_pass(times, positions)
    assert found is not None
    inner = slice(8, -8)
    np.testing.assert_allclose(found.positions[inner], on_a_line(found.times)[inner], atol=1e-9)
    seen = found.seen[:, N["wrist_left"]]
    assert not seen[(found.times > times[39] + 1e-6) & (found.times < times[50] - 1e-6)].any()
    assert seen[(found.times < times[39] - 1e-6) | (found.times > times[50] + 1e-6)].all()
    assert np.delete(found.seen, N["wrist_left"], axis=1).all()


def test_a_node_that_was_never_seen_is_missing_and_such_a_foot_is_its_ankle() -> None:
    times = np.arange(90) / 30.0
    positions = on_a_line(times)
    positions[:, [N["head"], N["foot_left"]]] = np.nan
    found = even_pass(times, positions)
    assert found is not None
    assert np.isnan(found.positions[:, N["head"]]).all()
    np.testing.assert_array_equal(found.positions[:, N["foot_left"]], found.positions[:, N["ankle_left"]])
    assert not found.seen[:, [N["head"], N["foot_left"]]].any()


def test_a_pass_that_is_too_short_or_never_shows_a_knee_is_none() -> None:
    times = np.arange(90) / 30.0
    assert even_pass(times[:14], on_a_line(times[:14])) is None
    positions = on_a_line(times)
    positions[:, N["knee_right"]] = np.nan
    assert even_pass(times, positions) is None
