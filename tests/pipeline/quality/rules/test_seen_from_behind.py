"""Bodies seen from behind."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import INFERRED
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.quality.check import check_capture
from kinemimic.pipeline.quality.passes import find_passes, with_passes
from kinemimic.pipeline.quality.rules import seen_from_behind
from kinemimic.pipeline.readers.recognise import read

Moving = Callable[..., Clip]
TOES = [N["foot_left"], N["foot_right"]]


def from_behind(clip: Clip, other_side: list[int]) -> Clip:
    """The clip as a Kinect records it from behind: sides swapped, and toes that point to the sensor."""
    p = clip.positions[:, other_side].copy()
    for side in ("left", "right"):
        ankle, foot = p[:, N[f"ankle_{side}"]], p[:, N[f"foot_{side}"]]
        p[:, N[f"foot_{side}"], :2] = 2.0 * ankle[:, :2] - foot[:, :2]
    return replace(clip, positions=p)


@pytest.mark.parametrize("belt", [False, True])
def test_a_walk_seen_from_behind(moving: Moving, other_side: list[int], belt: bool) -> None:
    clip = moving(150, noise=0.004)
    if belt:  # on a treadmill the hips stay
        clip.positions[..., 0] -= (
            (clip.positions[-1, 0, 0] - clip.positions[0, 0, 0]) * clip.times[:, None] / clip.times[-1]
        )
    assert seen_from_behind.repair(clip) == (clip, [])
    behind = from_behind(clip, other_side)
    behind = replace(behind, angles={"knee_left": np.zeros(150), "knee_right": np.ones(150)})
    repaired, (found,) = seen_from_behind.repair(behind)
    assert repaired.angles is not None
    assert repaired.angles["knee_left"].all() and not repaired.angles["knee_right"].any()
    assert np.all(repaired.states[:, TOES] == INFERRED)
    assert (found.rule, found.count, found.action) == ("swapped_sides", 150, "repaired")
    rest = np.delete(np.arange(20), TOES)
    assert np.array_equal(repaired.positions[:, rest], clip.positions[:, rest])


def test_a_walk_that_really_goes_backward(moving: Moving) -> None:
    """The walk played in reverse: the body walks backward, but the knees bend the usual way."""
    clip = moving(150)
    assert seen_from_behind.repair(replace(clip, positions=clip.positions[::-1].copy()))[1] == []


def test_only_the_pass_away_from_the_sensor(moving: Moving, other_side: list[int]) -> None:
    clip = moving(160, noise=0.004)
    away = from_behind(clip, other_side)
    there_and_back = replace(
        clip,
        positions=np.where(np.arange(160)[:, None, None] < 80, clip.positions, away.positions),
        passes=np.repeat(np.array([0, 1], dtype=np.int32), 80),
    )
    repaired, (found,) = seen_from_behind.repair(there_and_back)
    assert found.frames == ((80, 159),) and "in pass 1:" in found.text
    assert np.array_equal(np.delete(repaired.positions, TOES, 1), np.delete(clip.positions, TOES, 1))


def test_real_passes_from_behind(captures: Path) -> None:
    """The subjects of these recordings walk towards and away from the sensor in turn."""
    for name, passes in {"pd_1_a": "passes 0, 2:", "pd_1_c": "pass 0:", "r2": "pass 1:"}.items():
        clip = read(captures / "kinect1_bernstein_skl" / f"{name}.skl")
        (found,) = seen_from_behind.repair(with_passes(clip, find_passes(clip)))[1]
        assert f"seen from behind in {passes}" in found.text


@pytest.mark.parametrize("noise", [0.004, 0.008])
def test_legs_seen_from_behind_do_not_seem_exchanged_in_parts(
    moving: Moving, other_side: list[int], noise: float
) -> None:
    """Toes and trunk contradict the knees until the sides are put back."""
    clip = moving(150, noise=noise)
    behind = from_behind(clip, other_side)
    reading = {"reading": {"defects": []}}
    checked = check_capture(replace(behind, provenance={**behind.provenance, **reading}))
    assert [defect.count for defect in checked.defects if defect.rule == "swapped_sides"] == [150]
    ankle = N["ankle_left"]
    assert np.array_equal(checked.clip.positions[:, ankle], clip.positions[:, ankle])
