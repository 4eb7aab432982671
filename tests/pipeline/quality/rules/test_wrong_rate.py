"""Frame rates that no gait fits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from kinemimic.pipeline.kinematics.body_points import nodes_of
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.quality.rules import wrong_rate
from kinemimic.pipeline.readers import recognise

Moving = Callable[..., Clip]


@pytest.mark.parametrize(("kind", "low", "high"), [("walk", 1.1, 1.4), ("run", 0.6, 0.85)])
def test_the_stride_of_a_gait(moving: Moving, kind: str, low: float, high: float) -> None:
    clip = moving(240, kind=kind, noise=0.008)
    period = wrong_rate.stride_duration(nodes_of(clip), clip.times)
    assert period is not None and low < period < high
    assert wrong_rate.detect(clip) == []
    twice = wrong_rate.stride_duration(nodes_of(clip), 2.0 * clip.times)
    assert twice is not None and abs(twice - 2.0 * period) < 1e-6


def test_a_clock_that_no_walker_has(moving: Moving) -> None:
    clip = moving(240, noise=0.008)
    for factor in (0.25, 4.0):
        (found,) = wrong_rate.detect(replace(clip, times=factor * clip.times))
        assert (found.rule, found.action) == ("wrong_rate", "flagged")
    assert wrong_rate.detect(replace(clip, times=0.7 * clip.times)) == []  # brisk


def test_a_gait_that_changes_is_no_wrong_rate(moving: Moving, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its knees may repeat after several strides; the strides themselves are as long as a person's."""
    clip = moving(240, noise=0.008)
    period = wrong_rate.stride_duration(nodes_of(clip), clip.times)
    assert period is not None
    counted = wrong_rate.mean_stride(nodes_of(clip), clip.times)
    assert counted == pytest.approx(period, rel=0.1)
    for strides in (3.0, 0.3):
        monkeypatch.setattr(wrong_rate, "stride_duration", lambda *_, times=strides: times * period)
        assert wrong_rate.detect(clip) == []


def test_a_sprinters_ankles_on_a_walkers_knees(moving: Moving) -> None:
    """A brisk walk recorded at 30 Hz and declared as 60 Hz: its stride of 0.6 s is still human."""
    walk = moving(240)
    period = wrong_rate.stride_duration(nodes_of(walk), walk.times)
    assert period is not None
    clip = replace(walk, times=walk.times * 0.55 / period)
    (found,) = wrong_rate.detect(clip)
    assert (found.rule, found.action) == ("wrong_rate", "flagged")
    assert "the ankles separate at" in found.text
    # Who really runs, bends the knees for it.
    assert (
        wrong_rate.ankle_speed(nodes_of(moving(240, kind="run")), walk.times)
        > wrong_rate.MAX_WALKING_ANKLE_SPEED
    )
    assert wrong_rate.detect(moving(240, kind="run")) == []


def test_ankles_part_at_the_speed_that_they_have(node_clip: Moving) -> None:
    clip = node_clip(60)
    clip.positions[:] = 0.0
    clip.positions[:, N["ankle_left"], 0] = 3.0 * clip.times
    clip.positions[:, N["ankle_right"], 0] = -1.5 * clip.times
    assert wrong_rate.ankle_speed(nodes_of(clip), clip.times) == pytest.approx(4.5)


def test_no_stride_without_a_gait(moving: Moving, node_clip: Moving) -> None:
    clip = moving(240)
    assert wrong_rate.stride_duration(nodes_of(node_clip(240)), node_clip(240).times) is None
    # Both legs alike: a squat, however slow, is no walk.
    squat = clip.positions.copy()
    for joint in ("hip", "knee", "ankle"):
        squat[:, N[f"{joint}_right"]] = squat[:, N[f"{joint}_left"]] + [0.0, -0.2, 0.0]
    assert wrong_rate.stride_duration(squat, clip.times) is None
    assert wrong_rate.stride_duration(nodes_of(clip)[:20], clip.times[:20]) is None


@pytest.mark.parametrize(
    ("name", "factor", "flagged"),
    [
        ("07_12", 1.0, False),  # 1.8 m/s, 138 steps/min
        ("07_12", 1.2, False),  # 2.1 m/s, 164: a swinging foot is two and a half to three times as fast
        ("07_08", 2.0, False),  # 2.6 m/s, 191 steps/min of 0.8 m on a leg of 0.74 m, as race walkers make
        ("07_05", 2.0, False),  # a slow walk at twice its rate is a brisk one
        ("07_12", 2.0, True),
        ("07_01", 2.0, True),
        ("02_02", 2.0, True),
        ("07_01", 0.4, True),  # a stride takes 2.7 s
    ],
)
def test_recorded_walks_at_other_rates(captures: Path, name: str, factor: float, *, flagged: bool) -> None:
    path = captures.parent / "corpus" / "cmu_bvh" / f"{name}.bvh"
    if not path.is_file():
        pytest.skip("no corpus of walks beside the captures")
    clip = recognise.read(path)
    found = wrong_rate.detect(replace(clip, times=clip.times / factor))
    assert [defect.rule for defect in found] == ["wrong_rate"] * flagged


def test_without_a_known_stride_only_higher_speeds_are_doubted(moving: Moving) -> None:
    """A stride or less of a quick walk: its cadence is not known."""
    walk = moving(240)
    period = wrong_rate.stride_duration(nodes_of(walk), walk.times)
    assert period is not None
    frames = int(1.5 * period * walk.rate)
    clip = replace(moving(frames), passes=walk.passes[:frames])
    speed = wrong_rate.ankle_speed(nodes_of(clip), clip.times)
    assert wrong_rate.detect(replace(clip, times=clip.times * speed / 6.0)) == []
    (found,) = wrong_rate.detect(replace(clip, times=clip.times * speed / 9.0))
    assert "may be lower" in found.text
