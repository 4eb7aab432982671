"""Single-frame jumps and gaps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from kinemimic.pipeline.filters.fill import fill_gaps
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.quality.rules import gaps, jumps

Moving = Callable[..., Clip]
PLANTED = {
    (20, "knee_left"): 0.4,
    (20, "ankle_left"): 0.5,
    (57, "wrist_right"): 0.4,
    (90, "foot_right"): 0.45,
}


@pytest.mark.parametrize("kind", ["walk", "run"])
@pytest.mark.parametrize("rate", [15.0, 30.0, 120.0])
def test_a_sound_motion_has_none(moving: Moving, kind: str, rate: float) -> None:
    clip = moving(round(5 * rate), rate=rate, kind=kind, noise=0.008)
    assert jumps.repair(clip) == (clip, [])
    assert gaps.detect(clip) == []


@pytest.mark.parametrize(("kind", "tolerance"), [("walk", 0.02), ("run", 0.07)])
def test_jumps_are_taken_out_and_filled(moving: Moving, kind: str, tolerance: float) -> None:
    """A runner's ankle turns round within a frame or two of 33 ms: no curve brings its very place back."""
    clip = moving(120, kind=kind)
    broken = replace(clip, positions=clip.positions.copy())
    for (frame, joint), size in PLANTED.items():
        broken.positions[frame, N[joint], 1] += size
    repaired, (found,) = jumps.repair(broken)
    assert (found.rule, found.count, found.unit, found.action) == ("jumps", 4, "joint positions", "repaired")
    assert found.frames == ((20, 20), (57, 57), (90, 90))
    assert "up to 0.5" in found.text
    missing = np.zeros(clip.states.shape, dtype=np.bool_)
    for frame, joint in PLANTED:
        missing[frame, N[joint]] = True
    assert np.array_equal(np.isnan(repaired.positions).all(axis=-1), missing)
    assert np.array_equal(repaired.states == 0, missing)
    filled, where = fill_gaps(repaired.positions, repaired.times, repaired.passes)
    assert np.array_equal(where, missing)
    assert np.linalg.norm(filled - clip.positions, axis=-1).max() < tolerance


def test_a_move_to_another_place_is_no_jump(moving: Moving) -> None:
    """What does not come back, what takes two frames, and what lies at a pass's end."""
    clip = moving(120)
    clip.positions[60:, N["hand_left"], 2] += 0.3
    clip.positions[100:102, N["hand_right"], 2] += 0.3
    clip.positions[30, N["head"], 2] += 0.3
    clip.passes[31:] = 1
    assert jumps.repair(clip)[1] == []


def test_euler_captures_are_flagged(moving: Moving) -> None:
    clip = moving(60)
    clip.positions[30, 5] += 0.5
    euler = replace(clip, euler=np.zeros(clip.positions.shape), orders=("ZYX",) * 20)
    same, (found,) = jumps.repair(euler)
    assert same is euler and found.action == "flagged"


def without(clip: Clip, first: int, last: int, joint: str) -> None:
    clip.positions[first : last + 1, N[joint]] = np.nan
    clip.states[first : last + 1, N[joint]] = 0


def test_short_gaps_are_filled_and_long_ones_told(moving: Moving) -> None:
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
    assert "4 gaps inside passes, the longest 0.70 s: 2 of" in found.text and "2 will stay" in found.text
    assert found.frames == ((0, 1), (10, 14), (40, 60))


def test_the_count_is_what_cleaning_fills(moving: Moving) -> None:
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
