"""Who goes somewhere, and who exercises on the spot."""

from __future__ import annotations

import numpy as np

from kinemimic.retarget.live.on_the_spot import GOES, SPAN, STAYS, OnTheSpot

RATE = 30.0


def found(speeds: list[float], strides: bool) -> list[bool]:
    spot = OnTheSpot(RATE)
    return [spot.update(np.array([0.6, 0.8]) * speed, strides=strides) for speed in speeds]


def test_whoever_strides_away_goes_somewhere() -> None:
    assert found([0.0, 0.0], strides=True) == [True, True]
    assert found([1.2, 1.2], strides=True) == [False, False]


def test_without_strides_nobody_goes_anywhere() -> None:
    """The hips of a squat are as fast as those of a slow walk."""
    assert found([0.5] * 60, strides=False) == [True] * 60


def test_a_step_forth_and_back_leads_nowhere() -> None:
    """Within SPAN, the ways cancel."""
    half = round(0.5 * SPAN * RATE)
    forth_and_back = ([0.4] * half + [-0.4] * half) * 3
    assert all(found(forth_and_back, strides=True)[2 * half - 1 :: 2 * half])


def test_between_the_speeds_it_stays_as_it_was() -> None:
    between = 0.5 * (GOES + STAYS)
    assert found([between] * 40, strides=True)[-1]
    spot = OnTheSpot(RATE)
    for speed, expected in ((1.0, False), (between, False), (0.5 * STAYS, True), (between, True)):
        for _ in range(round(SPAN * RATE)):
            now = spot.update(np.array([speed, 0.0]), strides=True)
        assert now is expected
