"""Hips at the outside of the pelvis."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.proportions import HIPS, hips_to_leg
from kinemimic.pipeline.kinematics.rotations import IDENTITY
from kinemimic.pipeline.kinematics.skeleton import MISSING
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.quality.check import check_capture
from kinemimic.pipeline.quality.rules import wide_hips
from kinemimic.pipeline.readers.recognise import read

Moving = Callable[..., Clip]
LEFT, RIGHT = N["hip_left"], N["hip_right"]


def apart(clip: Clip, factor: float) -> Clip:
    """The clip with the hips at `factor` of their distance."""
    p = clip.positions.copy()
    by = 0.5 * (factor - 1.0) * (p[:, LEFT] - p[:, RIGHT])
    p[:, LEFT] += by
    p[:, RIGHT] -= by
    return replace(clip, positions=p)


@pytest.mark.parametrize("factor", [1.6, 2.0, 2.4])
def test_wide_hips_come_to_a_persons_distance(moving: Moving, factor: float) -> None:
    clip = moving(90)
    assert hips_to_leg(clip.positions) == pytest.approx(HIPS, abs=0.03)
    repaired, (found,) = wide_hips.repair(apart(clip, factor))
    assert (found.rule, found.action, found.count) == ("wide_hips", "repaired", 2)
    # The leg is a little longer than before, because it was measured from the wide hips.
    moved = np.linalg.norm(repaired.positions - clip.positions, axis=-1)
    assert moved[:, [LEFT, RIGHT]].max() < 0.015
    others = np.delete(np.arange(clip.positions.shape[1]), [LEFT, RIGHT])
    assert not moved[:, others].any()


@pytest.mark.parametrize("factor", [0.3, 0.6, 1.0, 1.3])
def test_hips_of_people_and_those_a_kinect_sees_too_narrow_stay(moving: Moving, factor: float) -> None:
    clip = apart(moving(90), factor)
    assert wide_hips.repair(clip) == (clip, [])


def test_a_hip_without_the_other_is_missing(moving: Moving) -> None:
    wide = apart(moving(60), 2.0)
    wide.positions[20:30, RIGHT] = np.nan
    wide.states[20:30, RIGHT] = MISSING
    repaired, _ = wide_hips.repair(wide)
    alone = np.zeros(60, dtype=bool)
    alone[20:30] = True
    assert np.array_equal(np.isnan(repaired.positions[:, LEFT, 0]), alone)
    assert np.array_equal(repaired.states[:, LEFT] == MISSING, alone)
    assert np.isfinite(wide.positions[:, LEFT]).all()  # not changed in place


def test_the_distance_is_judged_by_the_leg_in_any_unit(moving: Moving) -> None:
    clip = moving(90)
    small = replace(clip, positions=0.4 * apart(clip, 1.9).positions)
    assert hips_to_leg(wide_hips.repair(small)[0].positions) == pytest.approx(HIPS, abs=0.01)


def test_captures_of_rotations_keep_their_hips(moving: Moving) -> None:
    """Their thighs are as the rotations say, whatever the distance of the hips."""
    wide = apart(moving(30), 2.0)
    turned = replace(wide, rotations=np.broadcast_to(IDENTITY, (*wide.positions.shape[:2], 4)).copy())
    assert wide_hips.repair(turned) == (turned, [])


def test_feet_of_real_captures_no_longer_cross(captures: Path) -> None:
    """People who stand before a depth sensor whose hips are wide (MSR-Action3D). Which foot is on which side
    is known: their thighs, turned to the hips of a person, must not cross."""
    paths = sorted((captures / "kinect1_msraction3d").glob("a*_s05_e01_skeleton3D.txt"))
    assert paths
    for path in paths:
        before = read(path)
        after = check_capture(before).clip
        assert hips_to_leg(before.positions[:, _nodes(before)]) > 0.4
        assert hips_to_leg(after.positions[:, _nodes(after)]) == pytest.approx(HIPS, abs=0.02)
        assert ankles_on_narrow_hips(before) < 0.05 < 0.12 < ankles_on_narrow_hips(after)


def _nodes(clip: Clip) -> list[int]:
    return [clip.skeleton.names.index(name) for name in N]


def ankles_on_narrow_hips(clip: Clip) -> float:
    """How far the left ankle would be to the left of the right one if both legs hung from hips 0.22 of a leg
    apart, as a share of the leg; median."""
    p = clip.positions[:, _nodes(clip)]
    hips = p[:, LEFT] - p[:, RIGHT]
    across: Array = hips / np.linalg.norm(hips, axis=-1, keepdims=True)
    legs = [p[:, N[f"ankle_{side}"]] - p[:, N[f"hip_{side}"]] for side in ("left", "right")]
    leg = np.median(np.linalg.norm(legs[0], axis=-1))
    beside = np.sum((legs[0] - legs[1]) * across, axis=-1)
    return float(HIPS + np.median(beside) / leg)
