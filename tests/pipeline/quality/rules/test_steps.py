"""A camera that turns, a treadmill, a floor; and clocks that no gait fits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kinemimic.pipeline.kinematics.body_points import nodes_of
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import from_axis_angle, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.quality.passes import find_passes, with_passes
from kinemimic.pipeline.quality.rules import turning_camera, wrong_rate
from kinemimic.pipeline.readers.recognise import read

Moving = Callable[..., Clip]
RADIUS = 2.8


def along(clip: Clip) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """The way walked, steady: what a belt or a turning camera takes away."""
    hips = clip.positions[:, 0, 0]
    return hips[0] + (hips[-1] - hips[0]) * clip.times / clip.times[-1]


def around_the_camera(clip: Clip) -> Clip:
    """The straight walk bent onto a circle about a camera that keeps its eye on the walker."""
    p = clip.positions
    angle = (p[..., 0] - along(clip)[:, None]) / RADIUS
    distance = RADIUS - p[..., 1]
    return replace(
        clip, positions=np.stack([distance * np.sin(angle), distance * np.cos(angle), p[..., 2]], axis=-1)
    )


def on_a_treadmill(clip: Clip, degrees: float) -> Clip:
    """The walk on a belt 2.5 m before the camera, seen at an angle from its end."""
    p = clip.positions - np.array([1.0, 0.0, 0.0]) * along(clip)[:, None, None]
    return replace(
        clip, positions=rotate(from_axis_angle("Z", np.radians(degrees)), p) + np.array([2.5, 0.0, 0.0])
    )


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_a_camera_that_turns(moving: Moving, noise: float) -> None:
    (found,) = turning_camera.detect(around_the_camera(moving(180, noise=noise)))
    assert (found.rule, found.action) == ("turning_camera", "flagged")
    assert found.count > 60 and "joint angles are not affected" in found.text


def test_who_turns_on_the_spot_has_a_camera_that_stands(moving: Moving) -> None:
    """A turn a stride, begun at any angle: the feet slide past the hips, to all sides."""
    clip = moving(300)
    spot = on_a_treadmill(clip, 0.0)
    hips, period = spot.positions[:, :1], wrong_rate.stride_duration(nodes_of(clip), clip.times)
    assert period is not None
    for begin in np.linspace(0.0, np.pi, 8, endpoint=False):
        angles = begin + 2.0 * np.pi * clip.times / period
        turns = np.stack([from_axis_angle("Z", angle) for angle in angles])
        positions = rotate(turns[:, None], spot.positions - hips) + hips
        assert turning_camera.detect(replace(spot, positions=positions)) == []


@pytest.mark.parametrize("kind", ["walk", "run"])
def test_a_walk_over_the_floor_and_on_a_treadmill(moving: Moving, kind: str) -> None:
    clip = moving(180, kind=kind, noise=0.01)
    assert turning_camera.detect(clip) == []
    for degrees in (0.0, 45.0, 60.0, 180.0):
        assert turning_camera.detect(on_a_treadmill(clip, degrees)) == []


def test_real_cameras(captures: Path) -> None:
    floors = [
        captures / "kinect1_bernstein_skl" / f"{name}.skl" for name in ("i1", "r2", "micha_walk", "tal_l2r")
    ]
    floors += sorted((captures / "cmu_bvh").glob("*.bvh"))
    for path in floors:
        clip = read(path)
        assert turning_camera.detect(with_passes(clip, find_passes(clip))) == [], path.name


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
    """A brisk walk that was recorded at 30 Hz and is declared at 60: its stride of 0.6 s is human still."""
    walk = moving(240)
    period = wrong_rate.stride_duration(nodes_of(walk), walk.times)
    assert period is not None
    clip = replace(walk, times=walk.times * 0.55 / period)
    (found,) = wrong_rate.detect(clip)
    assert (found.rule, found.action) == ("wrong_rate", "flagged")
    assert "the ankles part at" in found.text
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


def test_what_is_no_gait_has_no_stride(moving: Moving, node_clip: Moving) -> None:
    clip = moving(240)
    assert wrong_rate.stride_duration(nodes_of(node_clip(240)), node_clip(240).times) is None
    # Both legs alike: a squat, however slow, is no walk.
    squat = clip.positions.copy()
    for joint in ("hip", "knee", "ankle"):
        squat[:, N[f"{joint}_right"]] = squat[:, N[f"{joint}_left"]] + [0.0, -0.2, 0.0]
    assert wrong_rate.stride_duration(squat, clip.times) is None
    assert wrong_rate.stride_duration(nodes_of(clip)[:20], clip.times[:20]) is None
