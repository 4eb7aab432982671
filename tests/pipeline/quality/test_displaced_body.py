"""Jumps of the whole body, for some frames or for good."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.quality.displaced_body import body_jumps, displaced_frames

Build = Callable[..., Clip]
ALL = np.ones(90, dtype=np.bool_)


def displaced(clip: Clip) -> list[int]:
    return np.flatnonzero(displaced_frames(clip, ALL[: len(clip.times)])).tolist()


def test_frames_in_another_place_between_others(node_clip: Build) -> None:
    clip = node_clip(90)
    wrong = [20, 40, 42, 60, 61]  # also every other frame, and two in a row
    clip.positions[wrong] += [1.5, 0.0, 1.0]
    assert displaced(clip) == wrong


def test_a_body_that_stays_there_is_another_one(node_clip: Build) -> None:
    clip = node_clip(90)
    clip.positions[50:] += [0.0, 1.8, 0.0]
    assert displaced(clip) == []
    assert np.flatnonzero(body_jumps(clip, ALL)).tolist() == [50]
    back_too_late = node_clip(90)
    back_too_late.positions[50:60] += [0.0, 1.8, 0.0]
    assert displaced(back_too_late) == []


def test_one_joint_and_a_sprinter_are_no_jumps(node_clip: Build) -> None:
    clip = node_clip(90)
    clip.positions[50, NODE_INDEX["hand_left"]] += 1.0
    clip.positions[..., 0] += 12.0 * clip.times[:, None]
    assert displaced(clip) == [] and not body_jumps(clip, ALL).any()


def test_a_few_frames_or_none(node_clip: Build) -> None:
    assert displaced(node_clip(1)) == []
    assert displaced_frames(node_clip(3), np.zeros(3, dtype=np.bool_)).tolist() == [False] * 3
