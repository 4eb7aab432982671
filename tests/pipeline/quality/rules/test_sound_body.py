"""A body without defects passes every rule about the whole body."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.quality.rules import (
    calibration_frames,
    limb_lengths,
    mirrored_body,
    wrong_units,
    wrong_up_axis,
)

Moving = Callable[..., Clip]


@pytest.mark.parametrize("kind", ["walk", "run"])
@pytest.mark.parametrize("noise", [0.0, 0.012])
def test_a_sound_body_has_no_defect(moving: Moving, kind: str, noise: float) -> None:
    clip = moving(120, kind=kind, noise=noise)
    for rule in (wrong_units, wrong_up_axis, mirrored_body, calibration_frames):
        assert rule.repair(clip) == (clip, [])
    assert limb_lengths.detect(clip) == []
