"""Bodies seen from behind."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from samples.walker import along, joined, standing, walker

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


def there_and_back(
    other_side: list[int], rate: float, back: float, noise: float, seed: int
) -> tuple[Clip, Clip, int]:
    """A walk to the sensor and, for `back` seconds, away from it again, in one pass: as it was, as a Kinect
    records it, and the first frame in which it takes the back for the front."""
    clip = walker(seconds=4.0 + 1.2 + back, rate=rate, noise=noise, seed=seed).clip
    turning = np.clip((clip.times - 4.0) / 1.2, 0.0, 1.0)
    clip = along(clip, np.pi * (0.5 - 0.5 * np.cos(np.pi * turning)))
    change = int(np.argmax(turning > 0.5))
    positions = clip.positions.copy()
    positions[change:] = from_behind(clip, other_side).positions[change:]
    return clip, replace(clip, positions=positions), change


@pytest.mark.parametrize("rate", [15.0, 30.0, 120.0])
@pytest.mark.parametrize("back", [2.5, 5.0, 25.0])
def test_a_walk_there_and_back_in_one_pass(other_side: list[int], rate: float, back: float) -> None:
    for seed in range(2):
        clip, recorded, change = there_and_back(other_side, rate, back, 0.015, seed)
        repaired, (found,) = seen_from_behind.repair(recorded)
        assert found.text.startswith("seen from behind in part of pass 0:")
        assert found.frames == ((change, len(clip.times) - 1),)
        assert np.array_equal(np.delete(repaired.positions, TOES, 1), np.delete(clip.positions, TOES, 1))


def test_who_stands_after_the_way_back_faces_the_sensor_again(other_side: list[int]) -> None:
    """Without strides nothing shows the back of a body: only the walk is repaired."""
    clip = walker(seconds=11.0, rate=30.0, noise=0.012).clip
    turning = np.clip((clip.times - 4.0) / 1.2, 0.0, 1.0) + np.clip((clip.times - 9.0) / 1.2, 0.0, 1.0)
    clip = along(clip, np.pi * turning)
    clip = joined(clip, standing(clip, 4.0, frame=-1))
    away = np.pad(np.abs(turning - 1.0) < 0.5, (0, 120))
    rng = np.random.default_rng(0)
    positions = np.where(away[:, None, None], from_behind(clip, other_side).positions, clip.positions)
    recorded = replace(clip, positions=positions + 0.01 * rng.standard_normal(positions.shape))
    _, (found,) = seen_from_behind.repair(recorded)
    frames = np.flatnonzero(away)
    assert found.frames == ((frames[0], frames[-1]),)


def test_a_turn_is_no_change_of_sides(other_side: list[int]) -> None:
    """A sensor that sees where the body faces; and a person who goes back without turning round."""
    clip, _, change = there_and_back(other_side, 30.0, 4.0, 0.01, 0)
    assert seen_from_behind.repair(clip) == (clip, [])
    positions = np.concatenate([clip.positions[:change], clip.positions[:change][::-1]])
    times = np.arange(2 * change) / 30.0
    same, found = seen_from_behind.repair(
        replace(
            clip,
            times=times,
            positions=positions,
            states=np.full(positions.shape[:2], 2, dtype=np.uint8),
            passes=np.zeros(len(times), dtype=np.int32),
        )
    )
    assert np.array_equal(same.positions, positions) and found == []


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
