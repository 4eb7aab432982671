"""Legs that the sensor did not see."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import INFERRED
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.quality.rules import hidden_legs


@pytest.mark.parametrize(("frames", "flagged"), [(0, False), (80, False), (100, True)])
def test_legs_that_are_mostly_guessed_are_flagged(
    moving: Callable[..., Clip], frames: int, flagged: bool
) -> None:
    clip = moving(120)
    clip.states[:frames, [N["knee_left"], N["ankle_left"]]] = INFERRED
    clip.states[:, N["foot_right"]] = INFERRED  # a foot is often guessed
    found = hidden_legs.detect(clip)
    assert bool(found) == flagged
    for one in found:
        assert (one.rule, one.count, one.action) == ("hidden_legs", 2, "flagged")
        assert "knee left 83 %, ankle left 83 %" in one.text
