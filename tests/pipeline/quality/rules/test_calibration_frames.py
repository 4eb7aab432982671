"""Calibration poses at the start."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.quality.rules import (
    calibration_frames,
)

Moving = Callable[..., Clip]


def t_pose(clip: Clip) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    pose = clip.positions[0].copy()
    for side, sign in (("left", 1.0), ("right", -1.0)):
        shoulder = pose[N[f"shoulder_{side}"]]
        for k, joint in enumerate(("elbow", "wrist", "hand"), start=1):
            pose[N[f"{joint}_{side}"]] = shoulder + np.array([0.0, 0.27 * sign * k, 0.0])
        for joint, height in (("knee", -0.42), ("ankle", -0.82), ("foot", -0.85)):
            pose[N[f"{joint}_{side}"]] = pose[N[f"hip_{side}"]] + [0.0, 0.0, height]
    return pose


@pytest.mark.parametrize(("rate", "noise"), [(30.0, 0.012), (60.0, 0.006), (120.0, 0.004)])
def test_a_held_pose_is_one_in_spite_of_the_noise(moving: Moving, rate: float, noise: float) -> None:
    clip = moving(int(8 * rate), rate=rate, noise=noise)
    broken = replace(clip, positions=clip.positions.copy())
    held = int(1.3 * rate)
    shake = noise * np.random.default_rng(1).standard_normal(broken.positions[:held].shape)
    broken.positions[:held] = t_pose(clip) + shake
    (found,) = calibration_frames.repair(broken)[1]
    assert (found.count, found.action) == (held, "repaired")


@pytest.mark.parametrize("frames", [1, 3, 40])
def test_a_calibration_pose_is_dropped(moving: Moving, frames: int) -> None:
    clip = moving(90, noise=0.004)
    broken = replace(clip, positions=clip.positions.copy())
    broken.positions[:frames] = t_pose(clip)
    repaired, (found,) = calibration_frames.repair(broken)
    assert (found.rule, found.count, found.action) == ("calibration_frames", frames, "repaired")
    assert np.array_equal(repaired.positions, clip.positions[frames:])
    assert np.array_equal(repaired.times, clip.times[frames:])


def test_somebody_who_begins_in_a_t_pose_and_lowers_the_arms_is_kept(moving: Moving) -> None:
    clip = moving(90)
    share = np.clip((np.arange(90) - 20) / 15.0, 0.0, 1.0)[:, None, None]
    lowered = replace(clip, positions=(1.0 - share) * t_pose(clip) + share * clip.positions)
    assert calibration_frames.repair(lowered) == (lowered, [])


def test_arms_held_out_during_the_motion_are_no_calibration(moving: Moving) -> None:
    clip = moving(90)
    held = (
        clip.positions
        + (t_pose(clip) - clip.positions[0]) * np.isin(np.arange(20), [5, 6, 7, 9, 10, 11])[:, None]
    )
    assert calibration_frames.repair(replace(clip, positions=held))[1] == []


def test_a_walk_with_the_arms_out_whose_sides_jump_is_no_calibration(moving: Moving) -> None:
    """As in a tandem walk: all frames are a walk, and the jump is another defect."""
    clip = moving(300, noise=0.004)
    out = clip.positions.copy()
    for side, sign in (("left", 1.0), ("right", -1.0)):
        for k, joint in enumerate(("elbow", "wrist", "hand"), start=1):
            out[:, N[f"{joint}_{side}"]] = out[:, N[f"shoulder_{side}"]] + [0.0, 0.27 * sign * k, 0.0]
    assert calibration_frames.repair(replace(clip, positions=out))[1] == []
    out[200] *= 0.5
    assert calibration_frames.repair(replace(clip, positions=out))[1] == []
