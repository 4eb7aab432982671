"""A body is recognised among numbers in any unit and heading, up or down the image; other numbers are not."""

from __future__ import annotations

import numpy as np
import pytest
from samples.motion import in_range, walk, y_up

from kinemimic.pipeline.readers.base.body_posture import is_upright_body


@pytest.mark.parametrize("scale", [1.0, 0.01, 1000.0])
@pytest.mark.parametrize("up", [1.0, -1.0])
@pytest.mark.parametrize("turn", [0.0, 1.0, 2.5])
def test_a_walking_person_is_a_body(scale: float, up: float, turn: float) -> None:
    points = y_up(in_range(walk(30)))
    x, y, z = np.moveaxis(points, -1, 0)
    turned = np.stack([np.cos(turn) * x + np.sin(turn) * z, up * y, np.cos(turn) * z - np.sin(turn) * x], -1)
    assert is_upright_body(scale * turned)


def test_other_numbers_are_not_a_body() -> None:
    points = y_up(in_range(walk(30)))
    assert not is_upright_body(points[:, ::-1])  # joints in another order
    assert not is_upright_body(points[..., [1, 0, 2]])  # lying
    assert not is_upright_body(np.random.default_rng(7).normal(size=(30, 20, 3)))
    assert not is_upright_body(np.zeros((30, 20, 3)))
    assert not is_upright_body(np.full((30, 20, 3), np.nan))
    assert not is_upright_body(1e300 * points)
    assert not is_upright_body(points[:0])
