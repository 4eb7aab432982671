"""The half strides into and out of standing are left out, and named."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from samples.bouts import bouts_of
from samples.walker import in_place, stand_walk_stand, walker

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.files.store import read_clip
from kinemimic.pipeline.ingest import ingest
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.locomotion.bouts import find_bouts
from kinemimic.pipeline.locomotion.standing import (
    INTO,
    OUT_OF,
    Transition,
    kind_of,
    on_phase,
    steady_frames,
    steady_span,
    transitions,
)


@pytest.mark.parametrize("noise", [0.0, 1e-5, 0.01])
def test_the_half_strides_next_to_standing_are_left_out_and_named(noise: float) -> None:
    clip = stand_walk_stand()
    error = noise * np.random.default_rng(0).standard_normal(clip.positions.shape)
    (bout,) = bouts_of(replace(clip, positions=clip.positions + error))
    assert [one.reason for one in (bout.strides[0], bout.strides[-1])] == [OUT_OF, INTO]
    assert all(one.walking and not one.transition for one in bout.strides[1:-1])
    assert bout.used_strides == pytest.approx(4.2, abs=0.3)
    assert bout.cycles == pytest.approx(bout.used_strides + 1.0, abs=0.2)
    # Nothing of the blends, which end 0.2 s after 3.0 s and begin 0.2 s before 8.5 s, is used.
    used = clip.times[bout.frames[bout.leg_mask().any(axis=1)]]
    assert 3.2 < used[0] < 3.7 and 7.8 < used[-1] < 8.3
    assert bout.period == pytest.approx(1.1, rel=0.01)


def test_a_stop_between_two_walks_makes_two_bouts() -> None:
    one, other = stand_walk_stand(4.0, 1.5), stand_walk_stand(4.0, 1.5)
    walked = other.positions + np.array([one.positions[-1, 0, 0] - other.positions[0, 0, 0], 0.0, 0.0])
    clip = replace(
        one,
        times=np.concatenate([one.times, one.times[-1] + 1.0 / 60.0 + other.times]),
        positions=np.concatenate([one.positions, walked]),
        states=np.concatenate([one.states, other.states]),
        passes=np.concatenate([one.passes, other.passes]),
    )
    bouts = bouts_of(clip)
    assert len(bouts) == 2
    for bout in bouts:
        assert [stride.transition for stride in bout.strides if stride.transition] == [OUT_OF, INTO]
        assert bout.used_strides == pytest.approx(3.0, abs=0.4)


def test_a_few_steps_of_a_person_who_turns_and_stands_are_no_walk(sensors: Path, tmp_path: Path) -> None:
    ingest(sensors / "mediapipe_csv" / "vokulovskiy_pose_landmarks.csv", tmp_path / "run")
    clip = read_clip(tmp_path / "run" / "clip.parquet")
    assert not find_bouts(clip.times, clip.passes, to_nodes(clip)[0])


@pytest.mark.parametrize("period", [0.9, 1.1, 2.0])
@pytest.mark.parametrize("still", [False, True])
def test_steady_walks_have_no_such_strides(period: float, still: bool) -> None:
    clip = walker(seconds=6.0 * period, period=period, noise=0.003).clip
    (bout,) = bouts_of(in_place(clip) if still else clip)
    assert not any(one.transition for one in bout.strides)
    assert bout.used_strides == pytest.approx(6.0, abs=0.1)


def wave(strides: float) -> tuple[Array, Array]:
    """Phase (T,) and ankles (T, 3) of strides of 1 s after and before 2 s of standing."""
    times = np.arange(round((4.0 + strides) * 60.0)) / 60.0
    moving = (times >= 2.0) & (times <= 2.0 + strides)
    ankles = 0.6 * np.sin(2.0 * np.pi * (times - 2.0)) * moving
    return times, ankles[:, None] * [1.0, 0.0, 0.0]


@pytest.mark.parametrize(("strides", "kinds"), [(1.7, []), (4.0, [OUT_OF, INTO])])
def test_between_the_half_strides_there_is_a_whole_one(strides: float, kinds: list[str]) -> None:
    phase, ankles = wave(strides)
    seen = np.ones(len(phase), dtype=np.bool_)
    found = transitions(ankles, seen, phase, amplitude=0.6, period=1.0)
    assert [one.kind for one in found] == kinds
    if kinds:
        assert [found[0].start, found[1].end] == pytest.approx([2.0, 2.0 + strides], abs=0.08)
    assert transitions(ankles, ~seen, phase, amplitude=0.6, period=1.0) == []


def test_the_steady_frames_are_those_between_the_half_strides() -> None:
    phase = np.arange(100) / 10.0
    assert steady_frames(phase, []).all()
    found = [Transition(1.0, 1.5, OUT_OF), Transition(4.0, 4.5, INTO), Transition(6.0, 6.5, OUT_OF)]
    steady = (phase > 1.5) & (phase < 4.0) | (phase > 6.5)
    assert np.array_equal(steady_frames(phase, found), steady)
    moved = on_phase(found, phase, 2.0 * phase - 3.0)
    ends = np.array([(one.start, one.end) for one in moved])
    np.testing.assert_allclose(ends, [(-1.0, 0.0), (5.0, 6.0), (9.0, 10.0)], atol=1e-9)


def test_where_a_stride_lies() -> None:
    phase = np.linspace(-3.0, 6.0, 500)
    found = [Transition(-1.0, -0.5, OUT_OF), Transition(4.0, 4.5, INTO)]
    assert kind_of(-1.0, -0.5, found) == OUT_OF and kind_of(4.0, 4.5, found) == INTO
    assert kind_of(-0.5, 0.0, found) == "" and kind_of(-3.0, -1.0, found) == ""
    assert steady_span(1.0, 2.0, phase, found) == (-0.5, 4.0)
    assert steady_span(1.0, 2.0, phase, []) == (-3.0, 6.0)
