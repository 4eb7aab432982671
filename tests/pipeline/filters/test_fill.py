"""Gaps: which are filled, with what, and which stay."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from kinemimic.pipeline.filters.fill import fill_gaps
from kinemimic.pipeline.kinematics.clip import Clip

Build = Callable[..., Clip]


def test_gaps_up_to_a_fifth_of_a_second_are_filled(node_clip: Build) -> None:
    clip = node_clip(90)
    whole = clip.positions.copy()
    for joint, gap in {
        2: slice(40, 41),
        3: slice(40, 46),
        4: slice(40, 47),
        5: slice(0, 3),
        6: slice(87, 90),
    }.items():
        clip.positions[gap, joint] = np.nan
    values, filled = fill_gaps(clip.positions, clip.times, clip.passes)
    assert np.flatnonzero(filled[:, 2]).tolist() == [40]
    assert np.flatnonzero(filled[:, 3]).tolist() == [40, 41, 42, 43, 44, 45]
    assert not filled[:, 4:].any()  # too long, and the edges
    assert np.isnan(values[40:47, 4]).all()
    assert np.abs(values - whole)[filled].max() < 0.002
    assert np.array_equal(values[~filled], clip.positions[~filled], equal_nan=True)


def test_a_long_gap_does_not_keep_a_short_one_from_being_filled(node_clip: Build) -> None:
    clip = node_clip(90)
    clip.positions[20:40, 3] = np.nan
    clip.positions[60:62, 3] = np.nan
    _, filled = fill_gaps(clip.positions, clip.times, clip.passes)
    assert np.flatnonzero(filled[:, 3]).tolist() == [60, 61]


def test_no_gap_is_filled_across_the_end_of_a_pass(node_clip: Build) -> None:
    clip = node_clip(90)
    clip.positions[28:32, 5] = np.nan
    for passes in (np.repeat([0, -1, 1], 30), np.repeat([0, 1, 2], 30)):
        assert not fill_gaps(clip.positions, clip.times, passes.astype(np.int32))[1].any()


@pytest.mark.parametrize("frames", range(1, 5))
def test_clips_with_nothing_on_one_side(node_clip: Build, frames: int) -> None:
    clip = node_clip(frames)
    clip.positions[-1, 3] = np.nan
    values, filled = fill_gaps(clip.positions, clip.times, clip.passes)
    assert not filled.any()
    assert np.array_equal(values, clip.positions, equal_nan=True)
