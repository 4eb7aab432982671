"""Repeated times, empty frames, and coordinates outside a sensor's range."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from samples import source_of

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.readers.base.frame_defects import increasing_times, refuse_remote, zero_frames


def test_a_frame_counts_if_it_is_later_than_all_before_it() -> None:
    later, (defect,) = increasing_times(np.array([5.0, 6.0, 6.0, 3.0, 4.0, 7.0]))
    assert later.tolist() == [True, True, False, False, False, True]
    assert (defect.rule, defect.count, defect.action) == ("duplicate_frames", 3, "repaired")
    assert increasing_times(np.arange(4.0))[1] == []


def test_a_clock_that_restarts_is_flagged() -> None:
    # A second recording of 30 lines after the first.
    later, (defect,) = increasing_times(np.tile(np.arange(30.0), 2))
    assert later.tolist() == [True] * 30 + [False] * 30
    assert (defect.action, defect.count) == ("flagged", 30)
    assert "30 of them are consecutive" in defect.text
    # The first recording is kept, also with a hole that the second would fill.
    holed = np.delete(np.arange(60.0), [30, 31, 32])
    later, (defect,) = increasing_times(np.concatenate([holed, np.arange(60.0)]))
    assert later.tolist() == [True] * 57 + [False] * 60
    assert defect.action == "flagged"
    # A time repeated thirty times is a stutter.
    later, (defect,) = increasing_times(np.repeat([1.0, 2.0], 30))
    assert (defect.action, defect.count, int(later.sum())) == ("repaired", 58, 2)


@pytest.mark.parametrize("place", [0, 9, 38])
def test_a_single_time_that_is_far_too_late_costs_its_own_line(place: int) -> None:
    clock = np.arange(39.0)
    clock[place] = 1e9
    later, found = increasing_times(clock)
    if place == 38:  # the last one is later than all before it
        assert later.all()
        assert found == []
        return
    assert np.flatnonzero(~later).tolist() == [place]
    assert (found[0].count, found[0].action) == (1, "repaired")


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
    refuse_remote(points, ("a", "b"), source, lambda frame: f"line {frame + 1}")
    points[2, 1, 2] = -101.0
    with pytest.raises(CaptureError, match=r"line 3: expected at most 100 m in Z of b, found -101"):
        refuse_remote(points, ("a", "b"), source, lambda frame: f"line {frame + 1}")


def test_a_body_far_from_the_origin_is_read_and_one_joint_there_is_not() -> None:
    """Walks of kilometres and the origins of maps: what counts is that the body stays together."""
    source = source_of("x", Path("a.txt"))

    def line(frame: int) -> str:
        return f"line {frame}"

    joints = ("a", "b", "c", "d")
    body = np.random.default_rng(3).uniform(0.5, 1.5, (400, 4, 3))
    walk = body + np.linspace(0.0, 900.0, 400)[:, None, None] * [1.0, -1.0, 0.0]
    walk[50, 1], walk[60:70] = np.nan, 0.0  # not seen
    remote_place = body + np.array([5e4, -5e4, 0.0])
    for points in (walk, remote_place):
        refuse_remote(points, joints, source, line)
        with pytest.raises(CaptureError, match="line 200: expected at most 100 m in Y of c, found"):
            refuse_remote(_with(points, (200, 2, 1), 180.0), joints, source, line)
        with pytest.raises(CaptureError, match=r"line 300: .* in Z of a, found .*; a whole body .* --unit"):
            refuse_remote(_with(points, (300, slice(None), 2), 180.0), joints, source, line)
        with pytest.raises(CaptureError, match=r"line 0: .* in Z of a"):
            refuse_remote(_with(points, (0, slice(None), 2), 180.0), joints, source, line)
    with pytest.raises(CaptureError, match="line 0: "):
        refuse_remote(body + 2e5, joints, source, line)
    # Millimetres, which no reader of metres may take for kilometres.
    with pytest.raises(CaptureError, match="line 0: "):
        refuse_remote(1000.0 * body, joints, source, line)
    # … but one of any unit, which the leg's length tells. One far joint is still none.
    refuse_remote(1000.0 * body, joints, source, line, any_unit=True)
    with pytest.raises(CaptureError, match="line 200: "):
        refuse_remote(_with(walk, (200, 2, 1), 180.0), joints, source, line, any_unit=True)


def _with(points: Array, place: tuple[int, int | slice, int], more: float) -> Array:
    changed = points.copy()
    changed[place] += more
    return changed


def test_the_message_is_in_the_files_unit() -> None:
    points = np.zeros((2, 1, 3))
    points[1, 0, 0] = 5e5
    with pytest.raises(
        CaptureError, match=r"frame 1: expected at most 100000 mm in X of PELVIS, found 5e\+08"
    ):
        refuse_remote(points, ("PELVIS",), source_of("x", Path("a.json")), unit="mm")
