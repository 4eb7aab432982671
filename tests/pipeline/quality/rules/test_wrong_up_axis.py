"""Wrong up-axes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from samples import source_of

from kinemimic.pipeline.convert import on_nodes
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.euler import rotations_of_channels, world_positions
from kinemimic.pipeline.kinematics.orientation.from_positions import node_rotations
from kinemimic.pipeline.kinematics.rotations import from_axis_angle, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.quality.rules import (
    mirrored_body,
    wrong_up_axis,
)
from kinemimic.pipeline.readers.mocap.bvh import read as read_bvh
from kinemimic.pipeline.readers.mocap.deepmimic import read_deepmimic, stock_motion

Moving = Callable[..., Clip]
Text = Callable[..., str]
WRONG_UPS = [("Y", 0.5), ("Y", -0.5), ("X", 0.5), ("X", -0.5), ("X", 1.0)]


@pytest.mark.parametrize(("axis", "halves"), WRONG_UPS)
def test_a_wrong_up_axis_is_turned_up(moving: Moving, axis: str, halves: float) -> None:
    clip = moving(90, noise=0.005)
    clip = replace(clip, rotations=node_rotations(clip.positions))
    wrong = wrong_up_axis.rotated_clip(clip, from_axis_angle(axis, halves * np.pi))
    repaired, (found,) = wrong_up_axis.repair(wrong)
    assert (found.rule, found.action) == ("wrong_up_axis", "repaired")
    # Up again; which way is forward is free, so distances from the start are what must be the same.
    np.testing.assert_allclose(repaired.positions[..., 2], clip.positions[..., 2], atol=1e-9)
    way = clip.positions - clip.positions[:1, :1]
    back = repaired.positions - repaired.positions[:1, :1]
    np.testing.assert_allclose(np.linalg.norm(back, axis=-1), np.linalg.norm(way, axis=-1), atol=1e-9)
    # Rotations go along: the root's frame still fits the body.
    fresh = node_rotations(repaired.positions)
    assert repaired.rotations is not None
    assert np.abs(np.sum(fresh[:, 0] * repaired.rotations[:, 0], axis=-1)).min() > 1.0 - 1e-9
    assert mirrored_body.repair(repaired)[1] == []


@pytest.mark.parametrize("bend", [0.0, 30.0, -30.0])
@pytest.mark.parametrize("tilt", [0.0, 20.0, 45.0])
def test_upside_down_before_a_tilted_sensor(moving: Moving, tilt: float, bend: float) -> None:
    """As of a camera that looks down, whose Y points down; a bending trunk may be level in its axes."""
    clip = moving(90, noise=0.005)
    upper = [N[name] for name in ("spine", "shoulder_center", "head", "shoulder_left", "shoulder_right")]
    hips, turn = clip.positions[:30, [N["hip_center"]]], from_axis_angle("Y", np.radians(bend))
    clip.positions[:30, upper] = hips + rotate(turn, clip.positions[:30, upper] - hips)
    wrong = wrong_up_axis.rotated_clip(clip, from_axis_angle("X", np.pi))
    wrong = wrong_up_axis.rotated_clip(wrong, from_axis_angle("Y", np.radians(tilt)))
    repaired, (found,) = wrong_up_axis.repair(wrong)
    assert (found.rule, found.action) == ("wrong_up_axis", "repaired")
    head, ankle = (repaired.positions[:, N[name], 2] for name in ("head", "ankle_left"))
    assert (head > ankle + 0.5).all()


def test_an_euler_capture_is_turned_in_its_axes(bvh: Text) -> None:
    """A BVH whose Z is up, read as if Y were: after the repair its channels give the repaired positions."""
    clip = read_bvh(source_of(bvh(), Path("a.bvh")))
    wrong = wrong_up_axis.rotated_clip(clip, from_axis_angle("X", 0.5 * np.pi))
    way = np.linspace(0.0, 2.0, len(wrong.times))[:, None] * [1.0, 0.0, 0.0]
    wrong.positions[:] += way[:, None]
    assert wrong.translations is not None and wrong.euler is not None and wrong.orders is not None
    wrong.translations[:, 0] += rotate(wrong.world_from_file * [-1, -1, -1, 1], way)
    repaired, (found,) = wrong_up_axis.repair(wrong)
    assert found.action == "repaired"
    assert repaired.translations is not None and repaired.euler is not None and repaired.orders is not None
    rotated_clip = rotations_of_channels(repaired.euler, repaired.orders, repaired.world_from_file)
    places = world_positions(repaired.skeleton, repaired.translations, rotated_clip, repaired.world_from_file)
    np.testing.assert_allclose(places, repaired.positions, atol=1e-9)
    assert np.median(repaired.positions[:, repaired.skeleton.names.index("Head"), 2]) > 1.0


def test_bending_or_lying_is_not_rotated(moving: Moving, node_clip: Moving) -> None:
    clip = moving(120)
    bent = (
        rotate(from_axis_angle("Y", 0.5 * np.pi), clip.positions - clip.positions[:, :1])
        + clip.positions[:, :1]
    )
    bending = replace(clip, positions=np.where(np.arange(120)[:, None, None] < 90, bent, clip.positions))
    assert wrong_up_axis.repair(bending)[1] == []
    lying = wrong_up_axis.rotated_clip(node_clip(60), from_axis_angle("Y", 0.5 * np.pi))
    same, (found,) = wrong_up_axis.repair(lying)
    assert same is lying and found.action == "flagged" and "lying" in found.text
    leaning = wrong_up_axis.rotated_clip(
        clip, from_axis_angle("Y", np.radians(25.0))
    )  # a camera that looks down
    assert wrong_up_axis.repair(leaning)[1] == []


@pytest.mark.parametrize(
    "motion", ["crawl", "getup_facedown", "getup_faceup", "roll", "cartwheel", "backflip"]
)
def test_a_real_lying_body_is_not_rotated(motion: str) -> None:
    """A crawl goes along the body's long axis; only a walk across it is rotated upright."""
    clip = read_deepmimic(stock_motion(motion))
    same, found = wrong_up_axis.repair(clip)
    assert same is clip and [defect.action for defect in found] == (["flagged"] if motion == "crawl" else [])


@pytest.mark.parametrize("heading", [0.0, 25.0, 65.0])
def test_a_crawl_in_any_direction_is_not_rotated(heading: float) -> None:
    """3 m, aslant to the axes of the file."""
    once = on_nodes(read_deepmimic(stock_motion("crawl")))
    way = (once.positions[-1, 0] - once.positions[0, 0]) * [1.0, 1.0, 0.0]
    positions = np.concatenate([once.positions[:-1] + k * way for k in range(4)])
    frames = len(positions)
    clip = replace(
        once,
        times=np.arange(frames) / 60.0,
        positions=rotate(from_axis_angle("Z", np.radians(heading)), positions),
        states=np.full(positions.shape[:2], 2, np.uint8),
        passes=np.zeros(frames, np.int32),
        rotations=None,
        angles=None,
    )
    same, found = wrong_up_axis.repair(clip)
    assert same is clip
    assert [defect.action for defect in found] == ["flagged"]


def test_the_noise_of_a_body_that_lies_is_no_walk(moving: Moving) -> None:
    """Two minutes, in which it slides by 0.3 m."""
    pose = rotate(from_axis_angle("Y", 0.5 * np.pi), moving(2).positions[0])
    slide = np.linspace(0.0, 0.3, 3600)[:, None, None] * [1.0, 0.0, 0.0]
    noise = 0.02 * np.random.default_rng(0).standard_normal((3600, 20, 3))
    clip = replace(
        moving(3600),
        positions=pose + slide + noise,
        rotations=None,
        angles=None,
        times=np.arange(3600) / 30.0,
    )
    same, found = wrong_up_axis.repair(clip)
    assert same is clip
    assert [defect.action for defect in found] == ["flagged"]


def test_leg_raises_are_no_steps_and_a_squat_is_one(moving: Moving) -> None:
    """Legs of a lying body swing to one side of the trunk only; a squat lowers the hips over planted feet."""
    stands = moving(1).positions[0]
    bend = np.sin(np.linspace(0.0, 4.0 * np.pi, 120)) ** 2
    raised, squat = np.repeat(stands[None], 120, axis=0), np.repeat(stands[None], 120, axis=0)
    legs = [N[f"{joint}_{side}"] for side in ("left", "right") for joint in ("knee", "ankle", "foot")]
    for frame, share in enumerate(bend):
        for leg, part in ((legs[:3], share), (legs[3:], 0.3 * share)):
            hip = stands[N["hip_left"] if leg is legs[:3] else N["hip_right"]]
            raised[frame, leg] = hip + rotate(from_axis_angle("Y", -part), stands[leg] - hip)
    above = [joint for joint in range(20) if joint not in legs]
    squat[:, above, 2] -= 0.3 * bend[:, None]
    for side in ("left", "right"):
        squat[:, N[f"knee_{side}"]] += np.outer(bend, [0.33, 0.0, -0.15])
    lying, wrong = (
        wrong_up_axis.rotated_clip(
            replace(moving(120), positions=positions), from_axis_angle("Y", 0.5 * np.pi)
        )
        for positions in (raised, squat)
    )
    assert [defect.action for defect in wrong_up_axis.repair(lying)[1]] == ["flagged"]
    assert [defect.action for defect in wrong_up_axis.repair(wrong)[1]] == ["repaired"]
