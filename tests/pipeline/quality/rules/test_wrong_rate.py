"""Frame rates that no gait fits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from kinemimic.pipeline.kinematics.body_points import nodes_of
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.quality.rules import wrong_rate

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
