"""Wrong length units."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from samples import source_of

from kinemimic.pipeline.kinematics.clip import Clip, scaled
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.quality.rules import (
    wrong_units,
)
from kinemimic.pipeline.readers.mocap.bvh import read as read_bvh

Moving = Callable[..., Clip]
Text = Callable[..., str]


@pytest.mark.parametrize(
    ("times", "name"),
    [
        (1000.0, "millimetres"),
        (100.0, "centimetres"),
        (1 / 0.0254, "inches"),
        (1 / 0.3048, "feet"),
        (0.1, "centimetres read as millimetres"),
        (0.01, "metres read as centimetres"),
        (0.001, "metres read as millimetres"),
    ],
)
def test_wrong_units_are_reported_and_repaired(moving: Moving, times: float, name: str) -> None:
    clip = moving(60)
    repaired, (found,) = wrong_units.repair(scaled(clip, times))
    assert (found.rule, found.action) == ("wrong_units", "repaired") and name in found.text
    np.testing.assert_allclose(repaired.positions, clip.positions, atol=1e-9)


def test_units_that_fit_twice_are_flagged_those_that_fit_never_refused(moving: Moving) -> None:
    clip = moving(60)
    leg = np.median(
        np.linalg.norm(clip.positions[:, N["hip_left"]] - clip.positions[:, N["knee_left"]], axis=-1)
    )
    leg += np.median(
        np.linalg.norm(clip.positions[:, N["knee_left"]] - clip.positions[:, N["ankle_left"]], axis=-1)
    )
    # A child in cm is likelier than a giant in inches.
    child, found = wrong_units.repair(scaled(clip, 45.0 / leg))
    np.testing.assert_allclose(child.positions, clip.positions * (0.45 / leg), atol=1e-9)
    assert [one.action for one in found] == ["repaired", "flagged"]
    assert "lengths are centimetres" in found[0].text and "of 2.33 m in inches; read in" in found[1].text
    assert wrong_units.repair(scaled(clip, 4.0 / leg))[1][0].action == "refused"
    assert wrong_units.repair(scaled(clip, 0.5 / leg))[1] == []  # a child in metres


def test_euler_captures_are_scaled_completely(bvh: Text) -> None:
    clip = read_bvh(source_of(bvh(), Path("a.bvh")))
    repaired, _ = wrong_units.repair(scaled(clip, 100.0))
    assert repaired.translations is not None and clip.translations is not None
    np.testing.assert_allclose(repaired.translations, clip.translations, atol=1e-12)
    np.testing.assert_allclose(repaired.skeleton.offsets, clip.skeleton.offsets, atol=1e-12)
