"""Mirrored bodies."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.quality.rules import (
    mirrored_body,
)

Moving = Callable[..., Clip]


@pytest.mark.parametrize("kind", ["walk", "run"])
def test_a_mirrored_body_is_reflected(moving: Moving, kind: str) -> None:
    clip = moving(90, kind=kind, noise=0.005)
    mirrored = replace(clip, positions=clip.positions * [1.0, -1.0, 1.0])
    repaired, (found,) = mirrored_body.repair(mirrored)
    assert (found.rule, found.count, found.action) == ("mirrored", 90, "repaired")
    assert np.array_equal(repaired.positions, clip.positions)
    euler = replace(mirrored, euler=np.zeros(clip.positions.shape), orders=("ZYX",) * 20)
    same, (found,) = mirrored_body.repair(euler)
    assert same is euler and found.action == "flagged"


def test_knees_alone_reveal_a_mirror_image(moving: Moving) -> None:
    """Marker sets of the legs have neither shoulders nor, sometimes, feet."""
    clip = moving(90)
    legs = replace(clip, positions=clip.positions.copy(), states=clip.states.copy())
    for name in ("shoulder_left", "shoulder_right", "foot_left", "foot_right"):
        legs.positions[:, N[name]], legs.states[:, N[name]] = np.nan, 0
    assert mirrored_body.repair(legs)[1] == []
    repaired, (found,) = mirrored_body.repair(replace(legs, positions=legs.positions * [1.0, -1.0, 1.0]))
    assert found.action == "repaired" and found.text.startswith("knees bend forward in")
    np.testing.assert_allclose(repaired.positions, legs.positions)


def test_sitting_on_the_heels_is_no_mirror_image(moving: Moving) -> None:
    """Fully bent knees are no more evidence than straight ones, and the toes do point backward."""
    clip = moving(60)
    p = clip.positions
    for side in ("left", "right"):
        hip = p[:, N[f"hip_{side}"]].copy()
        p[:, N[f"knee_{side}"]] = hip + np.array([0.42, 0.0, -0.05])
        p[:, N[f"ankle_{side}"]] = hip + np.array([0.02, 0.0, -0.10])
        p[:, N[f"foot_{side}"]] = hip + np.array([-0.12, 0.0, -0.10])
    same, (found,) = mirrored_body.repair(clip)
    assert same is clip and found.action == "flagged" and "heels" in found.text


def test_one_frame_with_feet_does_not_lower_the_bar_for_the_knees(moving: Moving) -> None:
    clip = moving(90)
    wrong = clip.positions * [1.0, -1.0, 1.0]
    p = np.where(np.arange(90)[:, None, None] % 3 < 2, wrong, clip.positions)  # a tracker that hesitates
    for side in ("left", "right"):
        p[1:, N[f"foot_{side}"]] = np.nan
    assert mirrored_body.repair(replace(clip, positions=p))[1] == []


def test_names_of_the_other_side_are_a_mirror_too(moving: Moving, other_side: list[int]) -> None:
    clip = moving(90)
    repaired, (found,) = mirrored_body.repair(replace(clip, positions=clip.positions[:, other_side]))
    assert found.action == "repaired"
    np.testing.assert_allclose(repaired.positions, clip.positions[:, other_side] * [1.0, -1.0, 1.0])
    assert mirrored_body.repair(repaired)[1] == []
