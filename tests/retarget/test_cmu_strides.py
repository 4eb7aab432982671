"""The table of strides counted by eye is consistent, so that detectors can be compared with it."""

from __future__ import annotations

import tomllib
from pathlib import Path

CLIPS = tomllib.loads(Path(__file__).with_name("cmu_strides.toml").read_text())
PERIODS = (0.7, 1.8)  # s: the fastest run and the slowest climb


def test_strides_agree_with_steps_and_times() -> None:
    assert len(CLIPS) == 71
    for name, clip in CLIPS.items():
        assert clip["strides"] == clip["steps"] // 2, name
        assert bool(clip["steps"]) == bool(clip["direction"]) or clip["direction"] == "sideways", name
        if clip["steps"]:
            period = 2.0 * (clip["end_s"] - clip["start_s"]) / clip["steps"]
            assert PERIODS[0] < period < PERIODS[1], name
