"""Legs that the sensor exchanged where one hid the other are exchanged back."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from samples.corpus import cmu
from samples.mirror import MIRROR
from samples.one_leg import one_leg_leads
from samples.walker import walker

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.locomotion.leg_pose import is_precise
from kinemimic.pipeline.quality.passes import find_passes, with_passes
from kinemimic.pipeline.quality.rules import exchanged_legs
from kinemimic.pipeline.readers.recognise import read

LEGS = [N[f"{joint}_{side}"] for joint in ("knee", "ankle", "foot") for side in ("left", "right")]


def sensor(seed: int = 0, heading: float = 0.0, rate: float = 30.0) -> Clip:
    """A walk as a depth sensor sees it: bones that change their lengths."""
    return walker(seconds=9.0, rate=rate, noise=0.01, seed=seed, heading=heading).clip


def crossings(clip: Clip) -> list[int]:
    """Frames at which the ankles pass each other."""
    ahead = clip.positions[:, N["ankle_right"]] - clip.positions[:, N["ankle_left"]]
    along = clip.positions[-1, 0, :2] - clip.positions[0, 0, :2]
    sign = np.sign(ahead[:, :2] @ along)
    # Noise may change the sign twice in one passing.
    where = np.flatnonzero(sign[1:] != sign[:-1]) + 1
    return [
        int(k) for k, before in zip(where, np.concatenate([[-9], where[:-1]]), strict=True) if k > before + 5
    ]


def exchanged(clip: Clip, *spans: tuple[int, int]) -> Clip:
    """Knees, ankles and feet exchanged between frames."""
    p = clip.positions.copy()
    for start, end in spans:
        p[start:end, LEGS] = clip.positions[start:end][:, [MIRROR[k] for k in LEGS]]
    return replace(clip, positions=p)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("heading", [0.0, 2.2])
def test_legs_exchanged_from_one_crossing_to_another_come_back_exactly(seed: int, heading: float) -> None:
    clip = sensor(seed, heading)
    at = crossings(clip)
    assert len(at) > 12
    broken = exchanged(clip, (at[3], at[5]), (at[9], at[10]))
    repaired, (found,) = exchanged_legs.repair(broken)
    assert (found.rule, found.action) == ("swapped_sides", "repaired") and "4 times" in found.text
    # At the crossing itself both ankles are at one place: a frame more or less.
    wrong = np.linalg.norm(repaired.positions - clip.positions, axis=-1).max(axis=1) > 1e-9
    near = np.min(np.abs(np.arange(len(wrong))[:, None] - np.array(at)), axis=1) <= 2
    assert not (wrong & ~near).any()


@pytest.mark.parametrize("rate", [15.0, 120.0])
def test_exchanged_legs_at_other_rates(rate: float) -> None:
    clip = sensor(rate=rate)
    even = crossings(sensor())
    at = [round(frame * rate / 30.0) for frame in even]
    repaired, _ = exchanged_legs.repair(exchanged(clip, (at[3], at[5]), (at[9], at[10])))
    wrong = np.linalg.norm(repaired.positions - clip.positions, axis=-1).max(axis=1) > 1e-9
    near = np.min(np.abs(np.arange(len(wrong))[:, None] - np.array(at)), axis=1) <= 0.1 * rate
    assert not (wrong & ~near).any()


@pytest.mark.parametrize("kind", ["kick", "lunge", "step-to"])
@pytest.mark.parametrize("rate", [15.0, 30.0, 120.0])
@pytest.mark.parametrize("period", [0.6, 0.9])
def test_one_leg_that_always_leads_is_no_exchange(
    kind: Literal["kick", "lunge", "step-to"], rate: float, period: float
) -> None:
    """The ankles meet without passing each other, but not as a walker's do."""
    clip = one_leg_leads(kind, rate, period, heading=0.7)
    assert not is_precise(clip.positions)
    assert exchanged_legs.repair(clip) == (clip, [])


def test_a_last_step_after_a_stand_does_not_inherit_the_exchanges_of_the_walk() -> None:
    clip = sensor()
    at = crossings(clip)
    # Exchanged to the end of the walk; then a stand of two seconds, feet together, and one more step.
    stand = at[-3]
    broken = exchanged(clip, (at[-6], stand))
    frames = np.r_[0:stand, np.full(60, stand), stand : at[-2]]
    longer = replace(
        broken,
        times=np.arange(len(frames)) / 30.0,
        positions=broken.positions[frames],
        states=broken.states[frames],
        passes=broken.passes[frames],
    )
    repaired, _ = exchanged_legs.repair(longer)
    wrong = np.linalg.norm(repaired.positions - clip.positions[frames], axis=-1).max(axis=1) > 1e-9
    assert not wrong[stand:].any()
    assert not wrong[at[-6] + 3 : at[-4]].any()


def test_a_walk_without_exchanges_is_unchanged() -> None:
    for seed in range(4):
        clip = sensor(seed)
        same, found = exchanged_legs.repair(clip)
        assert same is clip and found == []


def mirrored_from(clip: Clip, frame: int) -> Clip:
    """From a frame on, the mirror image of the person: a foot leads twice, and both legs are on their own
    sides, as after somebody has turned around."""
    along = clip.positions[-1, 0] - clip.positions[0, 0]
    across = np.array([-along[1], along[0], 0.0]) / np.hypot(along[0], along[1])
    late = clip.positions[frame:, MIRROR]
    off = (late - clip.positions[frame, 0]) @ across
    p = clip.positions.copy()
    p[frame:] = late - 2.0 * off[..., None] * across
    return replace(clip, positions=p)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("heading", [0.0, 2.2])
def test_a_foot_that_leads_twice_on_its_own_side_is_no_exchange(seed: int, heading: float) -> None:
    clip = sensor(seed, heading)
    for crossing in crossings(clip)[4:8:3]:
        turned = mirrored_from(clip, crossing)
        assert exchanged_legs.repair(turned) == (turned, [])
        # A real exchange beside it is still found.
        at = crossings(turned)
        broken = exchanged(turned, (at[1], at[2]))
        _, (found,) = exchanged_legs.repair(broken)
        assert found.frames[0][0] == pytest.approx(at[1], abs=2) and len(found.frames) == 1


def test_a_person_who_stands_is_unchanged() -> None:
    clip = sensor()
    rng = np.random.default_rng(0)
    still = clip.positions[:1] + 0.01 * rng.standard_normal(clip.positions.shape)
    assert exchanged_legs.repair(replace(clip, positions=still))[1] == []


@pytest.mark.parametrize("name", ["02_01", "05_01", "07_12"])
def test_an_optical_walk_is_unchanged(name: str) -> None:
    clip = cmu(name)
    same, found = exchanged_legs.repair(clip)
    assert same is clip and found == []


def test_one_leg_that_comes_back_in_front_of_a_depth_sensor(sensors: Path) -> None:
    """Five times the foot ahead comes back beside the other one, which stands, and goes ahead again."""
    clip = read(sensors / "azure_kinect_vicon" / "azure_positions.csv")
    clip = with_passes(clip, find_passes(clip))
    assert exchanged_legs.repair(clip) == (clip, [])


def test_walks_with_exchanged_legs(captures: Path) -> None:
    """In this walk towards a Kinect one foot would lead in two steps of three."""
    clip = read(captures / "kinect1_andersson_gait" / "Person083_2.txt")
    (found,) = exchanged_legs.repair(with_passes(clip, find_passes(clip)))[1]
    assert "24 times" in found.text
