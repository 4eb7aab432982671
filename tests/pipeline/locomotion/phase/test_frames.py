"""Frames between two phases: laws of a partition, and edges that rounding does not move."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from kinemimic.pipeline.locomotion.phase.frames import frames_between, within

PHASE = np.linspace(0.3, 2.7, 25)  # a tenth of a cycle per frame


def test_neighbouring_intervals_share_no_frame_and_miss_none() -> None:
    edges = [0.3, 0.75, 1.2, 1.9, 2.8]
    parts = [np.arange(25)[frames_between(PHASE, *pair)] for pair in pairwise(edges)]
    assert np.concatenate(parts).tolist() == list(range(25))


@pytest.mark.parametrize("rounding", [-4e-16, 0.0, 4e-16])
def test_a_frame_on_an_edge_is_there_whatever_the_rounding(rounding: float) -> None:
    start, end = PHASE[4] + rounding, PHASE[14] + rounding
    assert frames_between(PHASE, start, end) == slice(4, 14)
    assert np.flatnonzero(within(PHASE, start, end)).tolist() == list(range(4, 15))


def test_a_frame_beside_an_edge_is_judged_by_its_phase() -> None:
    assert frames_between(PHASE, PHASE[4] + 1e-6, PHASE[14] + 1e-6) == slice(5, 15)
    assert np.flatnonzero(within(PHASE, PHASE[4] + 1e-6, PHASE[14] - 1e-6)).tolist() == list(range(5, 14))


def test_open_ended_intervals() -> None:
    assert frames_between(PHASE, -np.inf, np.inf) == slice(0, 25)
    assert within(PHASE, -np.inf, np.inf).all()
