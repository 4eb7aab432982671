"""Repeated times, empty frames, and coordinates outside a sensor's range."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from samples import source_of

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.readers.base.frame_defects import increasing_times, refuse_remote, zero_frames


def test_a_frame_counts_if_it_is_later_than_all_before_it() -> None:
    later, (defect,) = increasing_times(np.array([5.0, 6.0, 6.0, 3.0, 4.0, 7.0]))
    assert later.tolist() == [True, True, False, False, False, True]
    assert (defect.rule, defect.count, defect.action) == ("duplicate_frames", 3, "repaired")
    assert increasing_times(np.arange(4.0))[1] == []


def test_a_clock_that_restarts_is_flagged() -> None:
    # A second recording of 30 lines after the first; one time far too late has the same effect.
    for clock in (np.tile(np.arange(30.0), 2), np.concatenate([np.arange(9.0), [1e9], np.arange(9.0, 39.0)])):
        later, (defect,) = increasing_times(clock)
        assert (defect.action, defect.count) == ("flagged", int((~later).sum()))
        assert "30 of them are consecutive" in defect.text
    # A time repeated thirty times is a stutter.
    later, (defect,) = increasing_times(np.repeat([1.0, 2.0], 30))
    assert (defect.action, defect.count, int(later.sum())) == ("repaired", 58, 2)


def test_empty_frames_are_named_as_runs() -> None:
    points = np.ones((9, 2, 3))
    points[[0, 4, 5, 8]] = 0.0
    points[2, 0] = 0.0  # one joint is no frame
    (defect,) = zero_frames(points)
    assert (defect.count, defect.frames) == (4, ((0, 0), (4, 5), (8, 8)))
    assert zero_frames(np.ones((3, 2, 3))) == []


def test_remote_coordinates_are_refused_and_missing_ones_are_not() -> None:
    source = source_of("x", Path("a.txt"))
    points = np.zeros((4, 2, 3))
    points[1, 0], points[1, 1] = np.nan, np.inf
    refuse_remote(points, ("a", "b"), source, lambda frame: frame + 1)
    points[2, 1, 2] = -101.0
    with pytest.raises(CaptureError, match=r"line 3: expected metres, at most 100, in b_Z, found -101"):
        refuse_remote(points, ("a", "b"), source, lambda frame: frame + 1)
