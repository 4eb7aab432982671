"""Which strides belong together, and that bouts of one pass share neither strides nor frames."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from samples.bouts import bouts_of
from samples.corpus import cmu, corpus, recorded
from samples.walker import backward, in_place, walker

from kinemimic.pipeline.kinematics.nodes import shows_feet
from kinemimic.pipeline.kinematics.proportions import complete
from kinemimic.pipeline.kinematics.skeleton import INFERRED, NODES
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.locomotion.bouts import find_bouts
from kinemimic.pipeline.locomotion.standing import INTO, OUT_OF
from kinemimic.pipeline.locomotion.strides import Stride
from kinemimic.pipeline.locomotion.summary import gait_summary
from kinemimic.pipeline.locomotion.walk_rule import consecutive_strides

PHASE = np.linspace(0.0, 10.0, 601)
AHEAD = np.zeros_like(PHASE)


def stride(start: float, end: float, *, walking: bool = True, transition: str = "") -> Stride:
    return Stride(
        start, end, (start, end), 1.0, 0.95, 0.3, 0.0,
        walking=walking and not transition, transition=transition,
    )  # fmt: skip


def spans(strides: list[Stride], heading: np.ndarray = AHEAD) -> list[list[tuple[float, float]]]:
    return [[(one.start, one.end) for one in group] for group in consecutive_strides(strides, heading, PHASE)]


def test_a_half_stride_into_standing_is_listed_once_and_ends_the_run() -> None:
    strides = [stride(0.0, 1.0), stride(1.0, 1.5, transition=INTO), stride(1.5, 2.5), stride(2.5, 3.5)]
    assert spans(strides) == [[(0.0, 1.0), (1.0, 1.5)], [(1.5, 2.5), (2.5, 3.5)]]


def test_standing_between_two_half_strides_is_in_neither_run() -> None:
    strides = [
        stride(0.0, 1.0),
        stride(1.0, 1.5, transition=INTO),
        stride(1.5, 1.8, walking=False),
        stride(1.8, 2.3, transition=OUT_OF),
        stride(2.3, 3.3),
    ]
    assert spans(strides) == [[(0.0, 1.0), (1.0, 1.5)], [(1.8, 2.3), (2.3, 3.3)]]


@pytest.mark.parametrize(("turn", "runs"), [(0.5, 1), (1.5, 2)])
def test_one_bad_stride_ends_a_run_where_the_heading_changes(turn: float, runs: int) -> None:
    heading = np.where(PHASE < 1.5, 0.0, turn)
    strides = [stride(0.0, 1.0), stride(1.0, 2.0, walking=False), stride(2.0, 3.0)]
    assert len(spans(strides, heading)) == runs
    two_bad = [stride(0.0, 1.0), stride(1.0, 2.0, walking=False), stride(2.0, 3.0, walking=False)]
    assert len(spans([*two_bad, stride(3.0, 4.0)])) == 2


@pytest.mark.parametrize("name", ["Person001_1", "Person002_3", "Person026_3", "Person028_1"])
def test_bouts_of_a_depth_sensor_share_neither_strides_nor_frames(name: str) -> None:
    """Walks away and back of a Kinect v1, with a stand between them, whose phase does not advance."""
    clip = recorded(corpus("kinect1_walks") / f"{name}.txt")
    bouts = bouts_of(clip)
    assert len(bouts) == 2
    strides = [(one.start, one.end) for bout in bouts for one in bout.strides]
    assert all(before[1] <= after[0] + 1e-9 for before, after in pairwise(strides))
    frames = np.concatenate([bout.frames for bout in bouts])
    assert (np.diff(frames) > 0).all()
    for bout in bouts:
        # What is called walking moves: no stride takes twice as long as the others.
        assert max(one.period for one in bout.strides if one.walking) < 1.5 * bout.period


def test_the_ground_of_a_walk_backward_is_under_the_foot_in_stance() -> None:
    clip = walker(seconds=6.0).clip
    (ahead,), (back,) = bouts_of(clip), bouts_of(backward(clip))
    assert back.backward and not ahead.backward
    ankles = [N["ankle_left"], N["ankle_right"]]
    heights = [np.median(bout.positions[:, ankles, 2].min(axis=1)) for bout in (ahead, back)]
    assert heights[1] == pytest.approx(heights[0], abs=0.002)


def test_a_walk_forward_and_back_has_the_speed_of_both() -> None:
    walk = walker(seconds=6.0)
    (ahead,), (back,) = bouts_of(walk.clip), bouts_of(backward(walk.clip))
    summary = gait_summary([ahead, back])
    assert summary is not None
    assert summary["speed_m_s"] == pytest.approx(walk.speed, rel=0.02)


def test_the_speed_of_a_runner_without_feet_comes_from_the_ankles() -> None:
    """An optical run on the spot, whose feet are derived at a right angle to the shanks."""
    clip = cmu("02_03")
    (recorded_run,) = bouts_of(clip)
    positions, states = clip.positions.copy(), clip.states.copy()
    complete(positions, states, {node for node in NODES if not node.startswith("foot")})
    assert not shows_feet(states)
    bare = in_place(replace(clip, positions=positions, states=states))
    speeds = {}
    for toes in (True, False):
        (bout,) = find_bouts(bare.times, bare.passes, bare.positions, toes=toes)
        assert bout.path.source == "feet" and bout.running
        speeds[toes] = bout.speed
    assert speeds[False] == pytest.approx(recorded_run.speed, rel=0.06)
    assert speeds[True] < 0.9 * recorded_run.speed


def test_derived_feet_are_not_shown() -> None:
    states = walker().clip.states.copy()
    assert shows_feet(states)
    states[:, N["foot_left"]] = INFERRED
    assert not shows_feet(states)
    states[7, N["foot_left"]] = 2
    assert shows_feet(states)
