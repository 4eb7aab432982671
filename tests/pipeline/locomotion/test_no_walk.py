"""Legs that differ much still walk, and steps that are no walk are said to be what they are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from samples.asymmetry import with_weak_leg
from samples.bouts import bouts_of
from samples.walker import standing, walker

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.locomotion.no_walk import why_no_walk


def why(clip: Clip) -> str:
    assert bouts_of(clip) == []
    return why_no_walk(clip.times, clip.passes, clip.positions)


@pytest.mark.parametrize("share", [0.65, 0.5])
def test_a_leg_that_swings_through_half_the_angle_is_one_of_a_walk(share: float) -> None:
    w = walker(seconds=7.7)
    (one,) = bouts_of(with_weak_leg(w.clip, share))
    assert one.cycles == pytest.approx(7.0, abs=0.1) and one.used_strides == one.cycles
    assert one.path.source == "recorded"
    assert one.speed == pytest.approx(w.speed, rel=0.02)


def test_a_leg_that_hardly_moves_is_the_reason() -> None:
    assert "left and right leg differ too much" in why(with_weak_leg(walker(seconds=7.7).clip, 0.05))


def test_steps_to_the_side_are_the_reason() -> None:
    clip = standing(walker(seconds=7.7).clip, 7.7)
    p = clip.positions.copy()
    swing = 0.3 * np.sin(2.0 * np.pi * clip.times / 1.1)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        hip = p[:, N[f"hip_{side}"]]
        down = np.stack([np.zeros_like(swing), np.sin(sign * swing), -np.cos(swing)], axis=1)
        p[:, N[f"knee_{side}"]] = hip + 0.44 * down
        p[:, N[f"ankle_{side}"]] = hip + 0.86 * down
        p[:, N[f"foot_{side}"]] = p[:, N[f"ankle_{side}"]] + [0.12, 0.0, -0.03]
    p[..., 1] += 0.5 * clip.times[:, None]
    assert "steps to the side" in why(replace(clip, positions=p))


def test_a_body_that_slides_is_the_reason() -> None:
    clip = walker(seconds=7.7).clip
    p = clip.positions.copy()
    p[..., 1] += 1.5 * clip.times[:, None]
    assert "path does not match its steps" in why(replace(clip, positions=p))


def test_nothing_is_said_of_a_person_who_stands() -> None:
    assert why(standing(walker().clip, 6.0)) == ""
