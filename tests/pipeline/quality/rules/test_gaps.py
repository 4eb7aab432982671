"""Gaps inside passes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kinemimic.pipeline.filters.fill import fill_gaps
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.quality.rules import gaps

Moving = Callable[..., Clip]


def without(clip: Clip, first: int, last: int, joint: str) -> None:
    clip.positions[first : last + 1, N[joint]] = np.nan
    clip.states[first : last + 1, N[joint]] = 0


def test_short_gaps_are_filled_and_long_gaps_flagged(moving: Moving) -> None:
    clip = moving(120)
    without(clip, 10, 14, "hand_left")
    without(clip, 12, 12, "foot_left")
    (found,) = gaps.detect(clip)
    assert (found.rule, found.count, found.action) == ("gaps", 6, "repaired")
    assert (
        "2 gaps inside passes, the longest 0.17 s: 2 of up to 0.2 s will be filled, 0 will stay" in found.text
    )
    without(clip, 40, 60, "hand_left")  # 0.7 s
    without(clip, 0, 1, "head")  # nothing before it
    (found,) = gaps.detect(clip)
    assert (found.count, found.action) == (6 + 21 + 2, "flagged")
    assert "4 gaps inside passes, the longest 0.70 s: 2 of" in found.text
    assert "2 will stay (1 at the start or end of a pass)" in found.text
    assert found.frames == ((0, 1), (10, 14), (40, 60))


def test_the_count_equals_the_gaps_that_cleaning_fills(moving: Moving) -> None:
    rng = np.random.default_rng(3)
    clip = moving(240)
    clip.passes[:] = np.repeat(np.array([0, -1, 1], dtype=np.int32), [100, 20, 120])
    for joint in range(20):
        for start in rng.integers(0, 230, size=6):
            stop = start + int(rng.integers(1, 10))
            clip.positions[start:stop, joint] = np.nan
            clip.states[start:stop, joint] = 0
    (found,) = gaps.detect(clip)
    _, where = fill_gaps(clip.positions, clip.times, clip.passes)
    count = sum(int((np.diff(where[:, joint].astype(int)) == 1).sum()) for joint in range(20))
    assert f"{count} of up to 0.2 s will be filled" in found.text


def test_a_joint_that_was_never_seen(moving: Moving) -> None:
    clip = moving(60)
    without(clip, 0, 59, "hand_left")
    (found,) = gaps.detect(clip)
    assert (found.count, found.unit, found.action) == (1, "joints", "flagged")
    assert found.text == "never seen: hand_left"
