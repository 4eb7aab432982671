"""Single-frame jumps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from kinemimic.pipeline.filters.fill import fill_gaps
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.quality.check import check_capture
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
    """A runner's ankle reverses within a frame or two of 33 ms: interpolation cannot restore its position."""
    clip = moving(120, kind=kind)
    broken = replace(clip, positions=clip.positions.copy())
    for (frame, joint), size in PLANTED.items():
        broken.positions[frame, N[joint], 1] += size
    repaired, (found,) = jumps.repair(broken)
    assert (found.rule, found.count, found.unit, found.action) == ("jumps", 4, "joint positions", "repaired")
    assert found.frames == ((20, 20), (57, 57), (90, 90))
    assert "up to 0.5" in found.text or "up to 0.49" in found.text
    missing = np.zeros(clip.states.shape, dtype=np.bool_)
    for frame, joint in PLANTED:
        missing[frame, N[joint]] = True
    assert np.array_equal(np.isnan(repaired.positions).all(axis=-1), missing)
    assert np.array_equal(repaired.states == 0, missing)
    filled, where = fill_gaps(repaired.positions, repaired.times, repaired.passes)
    assert np.array_equal(where, missing)
    assert np.linalg.norm(filled - clip.positions, axis=-1).max() < tolerance


def test_a_move_to_another_place_is_no_jump(moving: Moving) -> None:
    """A joint that does not return, a jump of two frames, and a jump at the end of a pass."""
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


def test_a_displaced_body_is_taken_out_and_filled(moving: Moving) -> None:
    """Twelve frames 1.8 m away: one pass, and the positions of the walk."""
    clip = moving(230, noise=0.002)
    wrong = [21, 45, 47, 56, 98, 133, 150, 151, 170, 190, 205, 220]
    broken = replace(clip, positions=clip.positions.copy())
    broken.positions[wrong] += [1.5, 0.0, 1.0]
    checked = check_capture(broken)
    (found,) = checked.defects
    assert (found.rule, found.count, found.unit, found.action) == ("jumps", 12, "frames", "repaired")
    assert checked.acquisition.count == 1
    assert np.flatnonzero(np.isnan(checked.clip.positions).all(axis=(1, 2))).tolist() == wrong
    filled, _ = fill_gaps(checked.clip.positions, checked.clip.times, checked.clip.passes)
    assert np.linalg.norm(filled - clip.positions, axis=-1).max() < 0.12
    channels = replace(broken, euler=np.full(clip.positions.shape, 0.1), orders=("ZYX",) * 20)
    mask = np.isin(np.arange(230), wrong)
    same, (flagged,) = jumps.repair_body(channels, mask)
    assert same is channels and flagged.action == "flagged"
