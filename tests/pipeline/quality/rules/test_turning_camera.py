"""A turning camera, a treadmill and a floor."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kinemimic.pipeline.kinematics.body_points import nodes_of
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import from_axis_angle, rotate
from kinemimic.pipeline.quality.passes import find_passes, with_passes
from kinemimic.pipeline.quality.rules import turning_camera, wrong_rate
from kinemimic.pipeline.readers.recognise import read

Moving = Callable[..., Clip]
RADIUS = 2.8


def along(clip: Clip) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """The path walked at a steady speed, which a belt or a turning camera removes."""
    hips = clip.positions[:, 0, 0]
    return hips[0] + (hips[-1] - hips[0]) * clip.times / clip.times[-1]


def around_the_camera(clip: Clip) -> Clip:
    """The straight walk bent onto a circle around a camera that follows the walker."""
    p = clip.positions
    angle = (p[..., 0] - along(clip)[:, None]) / RADIUS
    distance = RADIUS - p[..., 1]
    return replace(
        clip, positions=np.stack([distance * np.sin(angle), distance * np.cos(angle), p[..., 2]], axis=-1)
    )


def on_a_treadmill(clip: Clip, degrees: float) -> Clip:
    """The walk on a treadmill 2.5 m in front of the camera, at an angle to the line of sight."""
    p = clip.positions - np.array([1.0, 0.0, 0.0]) * along(clip)[:, None, None]
    return replace(
        clip, positions=rotate(from_axis_angle("Z", np.radians(degrees)), p) + np.array([2.5, 0.0, 0.0])
    )


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_a_camera_that_turns(moving: Moving, noise: float) -> None:
    (found,) = turning_camera.detect(around_the_camera(moving(180, noise=noise)))
    assert (found.rule, found.action) == ("turning_camera", "flagged")
    assert found.count > 60 and "joint angles are not affected" in found.text


def test_turning_on_the_spot_is_no_turning_camera(moving: Moving) -> None:
    """One turn per stride, from any start angle: the feet slide past the hips in all directions."""
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
