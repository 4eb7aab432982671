"""Passes begin and end at the right frames."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.quality.passes import State, find_passes, with_passes

Build = Callable[..., Clip]


def without_subject(clip: Clip, first: int, last: int) -> Clip:
    positions, states = clip.positions.copy(), clip.states.copy()
    positions[first : last + 1], states[first : last + 1] = np.nan, 0
    return replace(clip, positions=positions, states=states)


def spans(clip: Clip) -> list[tuple[int, int]]:
    passes = find_passes(clip).passes
    return [
        (int(np.flatnonzero(passes == k)[0]), int(np.flatnonzero(passes == k)[-1]))
        for k in range(passes.max() + 1)
    ]


def test_one_person_all_the_time(node_clip: Build) -> None:
    acquisition = find_passes(node_clip(60))
    assert acquisition.count == 1
    assert (acquisition.passes == 0).all()
    assert acquisition.complete.all()
    assert [e.state for e in acquisition.events] == [State.START, State.WAITING, State.TRACKING, State.END]
    assert np.array_equal(with_passes(node_clip(60), acquisition).passes, acquisition.passes)


def test_the_subject_comes_late_and_leaves_early(node_clip: Build) -> None:
    clip = without_subject(without_subject(node_clip(90), 0, 9), 70, 89)
    assert spans(clip) == [(10, 69)]
    states = [event.state for event in find_passes(clip).events]
    assert states == [State.START, State.WAITING, State.TRACKING, State.LOST, State.END]


def test_a_short_absence_does_not_end_a_pass_and_a_long_one_does(node_clip: Build) -> None:
    # At 30 Hz, five frames without a subject leave 6/30 = 0.2 s between those with one; six leave 0.233 s.
    assert spans(without_subject(node_clip(90), 40, 44)) == [(0, 89)]
    assert spans(without_subject(node_clip(90), 40, 46)) == [(0, 39), (47, 89)]


def test_a_jump_of_the_clock_ends_a_pass(node_clip: Build) -> None:
    times = np.arange(90) / 30.0
    times[40:] += 0.4
    assert spans(node_clip(90, times=times)) == [(0, 89)]
    times[40:] += 0.2
    assert spans(node_clip(90, times=times)) == [(0, 39), (40, 89)]
    reasons = [e.reason for e in find_passes(node_clip(90, times=times)).events if e.state is State.LOST]
    assert reasons == ["no frame for 0.63 s"]


def test_a_pose_that_repeats_for_long_is_no_subject(node_clip: Build) -> None:
    clip = node_clip(90)
    clip.positions[30:51] = clip.positions[29]
    assert spans(clip) == [(0, 29), (51, 89)]
    assert not find_passes(clip).complete[30:51].any()
    reasons = [event.reason for event in find_passes(clip).events if event.state is State.LOST]
    assert reasons == ["the last pose repeats for more than 0.2 s: nobody seen"]
    at_the_end = node_clip(90)
    at_the_end.positions[..., 0] += at_the_end.times[:, None]
    at_the_end.positions[60:] = at_the_end.positions[59]
    assert spans(at_the_end) == [(0, 59)]


def test_a_sensor_that_freezes_for_a_moment_does_not_end_a_pass(node_clip: Build) -> None:
    """The body goes on where it has got to meanwhile: at 120 Hz that is a jump within one frame."""
    for frames in (4, 10):
        clip = node_clip(90)
        clip.positions[30 : 30 + frames] = clip.positions[29]
        assert spans(clip) == [(0, 89)]
    fast = node_clip(400, rate=120.0)
    fast.positions[..., 0] += 1.4 * fast.times[:, None]
    fast.positions[100:140] = fast.positions[99]
    assert spans(fast) == [(0, 399)]
    assert not find_passes(fast).complete[100:140].any()


def test_a_body_in_another_place_for_a_moment_does_not_end_a_pass(node_clip: Build) -> None:
    clip = node_clip(90)
    clip.positions[[20, 40, 42]] += [0.0, 1.8, 0.0]
    assert spans(clip) == [(0, 89)]
    assert np.flatnonzero(~find_passes(clip).complete).tolist() == [20, 40, 42]


def test_a_still_recording_has_no_person(node_clip: Build) -> None:
    clip = node_clip(90)
    clip.positions[:] = clip.positions[0]
    assert find_passes(clip).count == 0
    assert find_passes(without_subject(node_clip(90), 0, 89)).count == 0


def test_an_impossible_jump_starts_another_pass(node_clip: Build) -> None:
    clip = node_clip(90)
    clip.positions[50:] += [0.0, 1.0, 0.0]
    assert spans(clip) == [(0, 49), (50, 89)]
    sprinter = node_clip(90)
    sprinter.positions[..., 0] += 12.0 * sprinter.times[:, None]
    assert spans(sprinter) == [(0, 89)]
    one_joint = node_clip(90)
    one_joint.positions[50:, NODE_INDEX["hand_left"]] += 1.0
    assert spans(one_joint) == [(0, 89)]


def test_short_passes_are_discarded_and_counted(node_clip: Build) -> None:
    clip = without_subject(without_subject(node_clip(120), 40, 59), 65, 84)
    acquisition = find_passes(clip)
    assert spans(clip) == [(0, 39), (85, 119)]
    assert acquisition.discarded == 1
    assert (acquisition.passes[60:65] == -1).all()


def test_complete_means_all_joints(node_clip: Build) -> None:
    clip = node_clip(60)
    clip.positions[7, NODE_INDEX["foot_left"]] = np.nan
    clip.states[7, NODE_INDEX["foot_left"]] = 0
    acquisition = find_passes(clip)
    assert np.flatnonzero(~acquisition.complete).tolist() == [7]
    assert acquisition.passes[7] == 0


@pytest.mark.parametrize("frames", [1, 2, 3])
def test_tiny_recordings(node_clip: Build, frames: int) -> None:
    assert find_passes(node_clip(frames)).count == 0
