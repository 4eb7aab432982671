from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from kinemimic.evaluate.simulate.replay import obstacle_columns
from kinemimic.train.sim.world import Obstacle

BALL = Obstacle("sphere", (0.24, 0.24, 0.24), (1.0, 0.0, 1.0), mass=1.0)
BOX = Obstacle("box", (0.3, 0.3, 0.4), (2.0, 0.0, 0.2), mass=2.0)


def frame(*there: tuple[int, Obstacle, float]) -> Any:
    """A frame with obstacles: number, look, and a number for every value of its state."""
    numbers, obstacles, values = zip(*there, strict=True) if there else ((), (), ())
    states = np.array([np.full(13, value) for value in values]).reshape(-1, 13)
    return SimpleNamespace(numbers=numbers, obstacles=obstacles, states=states)


def test_a_box_after_a_ball_is_a_box() -> None:
    frames = [frame(), frame((0, BALL, 1.0)), frame(), frame((1, BOX, 2.0)), frame((1, BOX, 3.0))]
    obstacles, states = obstacle_columns(frames)
    assert obstacles == [BALL, BOX]
    nan = np.nan
    np.testing.assert_array_equal(
        states[..., 0], [[nan, nan], [1.0, nan], [nan, nan], [nan, 2.0], [nan, 3.0]]
    )


def test_each_keeps_its_place_and_a_look_that_went_is_used_again() -> None:
    first, second = (0, BALL, 1.0), (1, BALL, 2.0)
    frames = [
        frame(first, second),
        frame(second),
        frame(second, (2, BOX, 3.0)),
        frame(second, (3, BALL, 4.0)),
    ]
    obstacles, states = obstacle_columns(frames)
    assert obstacles == [BALL, BALL, BOX]
    nan = np.nan
    expected = [[1.0, 2.0, nan], [nan, 2.0, nan], [nan, 2.0, 3.0], [4.0, 2.0, nan]]
    np.testing.assert_array_equal(states[..., 0], expected)
