"""Strides counted by eye in 71 clips, and what the pipeline makes of them."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest
from samples.bouts import bouts_of
from samples.corpus import cmu

from kinemimic.retarget.strides.selection import select_bouts

CLIPS = tomllib.loads(Path(__file__).with_name("cmu_strides.toml").read_text())
PERIODS = (0.7, 1.8)  # s: the fastest run and the slowest climb
SURE = {name: clip for name, clip in CLIPS.items() if clip["sure"]}


def test_strides_agree_with_steps_and_times() -> None:
    assert len(CLIPS) == 71
    for name, clip in CLIPS.items():
        assert clip["strides"] == clip["steps"] // 2, name
        assert bool(clip["steps"]) == bool(clip["direction"]) or clip["direction"] == "sideways", name
        if clip["steps"]:
            period = 2.0 * (clip["end_s"] - clip["start_s"]) / clip["steps"]
            assert PERIODS[0] < period < PERIODS[1], name


@pytest.mark.slow  # 40 s for the 71 clips, most of it for reading them
@pytest.mark.parametrize(
    "name", [n for n, c in SURE.items() if c["strides"] >= 2 and c["direction"] == "forward"]
)
def test_walks_and_runs_are_found_with_their_strides_to_a_fifth(name: str) -> None:
    by_eye = CLIPS[name]
    bouts = bouts_of(cmu(name))
    assert 0.8 * by_eye["strides"] <= sum(one.cycles for one in bouts)
    # The counted steps end before some clips do, which go on backward or elsewhere.
    counted = [
        stride.cycles
        for one in bouts
        for stride in one.strides
        if by_eye["start_s"] <= np.mean(stride.times) <= by_eye["end_s"]
    ]
    assert sum(counted) <= 1.2 * by_eye["strides"] + 1.0
    # 03_03 and 03_04 turn by more than 60 degrees in half of their strides, which no loop can use.
    assert select_bouts(bouts).strides >= 0.45 * by_eye["strides"]
    assert any(one.running for one in bouts) == (by_eye["activity"] == "run")


@pytest.mark.slow
@pytest.mark.parametrize("name", [n for n, c in SURE.items() if c["strides"] == 0])
def test_motions_without_strides_become_no_loop(name: str) -> None:
    assert select_bouts(bouts_of(cmu(name))).bouts == ()
