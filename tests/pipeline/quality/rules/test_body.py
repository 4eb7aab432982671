"""Units, up-axis, mirror, limbs and the pose for calibration: what is wrong with the body as a whole."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kinemimic.pipeline.kinematics.clip import Clip, scaled
from kinemimic.pipeline.kinematics.euler import rotations_of_channels, world_positions
from kinemimic.pipeline.kinematics.orient import node_rotations
from kinemimic.pipeline.kinematics.rotations import from_axis_angle, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.quality.rules import (
    calibration_frames,
    limb_lengths,
    mirrored_body,
    wrong_units,
    wrong_up_axis,
)
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.mocap.bvh import read as read_bvh
from kinemimic.pipeline.readers.mocap.deepmimic import read_deepmimic, stock_motion

Moving = Callable[..., Clip]
Text = Callable[..., str]
WRONG_UPS = [("Y", 0.5), ("Y", -0.5), ("X", 0.5), ("X", -0.5), ("X", 1.0)]


@pytest.mark.parametrize("kind", ["walk", "run"])
@pytest.mark.parametrize("noise", [0.0, 0.012])
def test_a_sound_body_has_no_defect(moving: Moving, kind: str, noise: float) -> None:
    clip = moving(120, kind=kind, noise=noise)
    for rule in (wrong_units, wrong_up_axis, mirrored_body, calibration_frames):
        assert rule.repair(clip) == (clip, [])
    assert limb_lengths.detect(clip) == []


# --- units


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
def test_wrong_units_are_told_and_repaired(moving: Moving, times: float, name: str) -> None:
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
    assert "lengths are centimetres" in found[0].text and "in inches of 2.33 m" in found[1].text
    assert wrong_units.repair(scaled(clip, 4.0 / leg))[1][0].action == "refused"
    assert wrong_units.repair(scaled(clip, 0.5 / leg))[1] == []  # a child in metres


def test_euler_captures_are_scaled_whole(bvh: Text) -> None:
    clip = read_bvh(Source.of_text(bvh(), Path("a.bvh")))
    repaired, _ = wrong_units.repair(scaled(clip, 100.0))
    assert repaired.translations is not None and clip.translations is not None
    np.testing.assert_allclose(repaired.translations, clip.translations, atol=1e-12)
    np.testing.assert_allclose(repaired.skeleton.offsets, clip.skeleton.offsets, atol=1e-12)


# --- up-axis


@pytest.mark.parametrize(("axis", "halves"), WRONG_UPS)
def test_a_wrong_up_axis_is_turned_up(moving: Moving, axis: str, halves: float) -> None:
    clip = moving(90, noise=0.005)
    clip = replace(clip, rotations=node_rotations(clip.positions))
    wrong = wrong_up_axis.turned(clip, from_axis_angle(axis, halves * np.pi))
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


def test_an_euler_capture_is_turned_in_its_axes(bvh: Text) -> None:
    """A BVH whose Z is up, read as if Y were: after the repair its channels give the repaired positions."""
    clip = read_bvh(Source.of_text(bvh(), Path("a.bvh")))
    wrong = wrong_up_axis.turned(clip, from_axis_angle("X", 0.5 * np.pi))
    way = np.linspace(0.0, 2.0, len(wrong.times))[:, None] * [1.0, 0.0, 0.0]
    wrong.positions[:] += way[:, None]
    assert wrong.translations is not None and wrong.euler is not None and wrong.orders is not None
    wrong.translations[:, 0] += rotate(wrong.world_from_file * [-1, -1, -1, 1], way)
    repaired, (found,) = wrong_up_axis.repair(wrong)
    assert found.action == "repaired"
    assert repaired.translations is not None and repaired.euler is not None and repaired.orders is not None
    turned = rotations_of_channels(repaired.euler, repaired.orders, repaired.world_from_file)
    places = world_positions(repaired.skeleton, repaired.translations, turned, repaired.world_from_file)
    np.testing.assert_allclose(places, repaired.positions, atol=1e-9)
    assert np.median(repaired.positions[:, repaired.skeleton.names.index("Head"), 2]) > 1.0


def test_who_bends_or_lies_is_not_turned(moving: Moving, node_clip: Moving) -> None:
    clip = moving(120)
    bent = (
        rotate(from_axis_angle("Y", 0.5 * np.pi), clip.positions - clip.positions[:, :1])
        + clip.positions[:, :1]
    )
    bending = replace(clip, positions=np.where(np.arange(120)[:, None, None] < 90, bent, clip.positions))
    assert wrong_up_axis.repair(bending)[1] == []
    lying = wrong_up_axis.turned(node_clip(60), from_axis_angle("Y", 0.5 * np.pi))
    same, (found,) = wrong_up_axis.repair(lying)
    assert same is lying and found.action == "flagged" and "lying" in found.text
    leaning = wrong_up_axis.turned(clip, from_axis_angle("Y", np.radians(25.0)))  # a camera that looks down
    assert wrong_up_axis.repair(leaning)[1] == []


@pytest.mark.parametrize(
    "motion", ["crawl", "getup_facedown", "getup_faceup", "roll", "cartwheel", "backflip"]
)
def test_who_really_is_on_the_floor_stays_there(motion: str) -> None:
    """A crawl goes along the body's length: it might be turned up only where somebody walked across it."""
    clip = read_deepmimic(stock_motion(motion))
    same, found = wrong_up_axis.repair(clip)
    assert same is clip and [defect.action for defect in found] == (["flagged"] if motion == "crawl" else [])


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
        wrong_up_axis.turned(replace(moving(120), positions=positions), from_axis_angle("Y", 0.5 * np.pi))
        for positions in (raised, squat)
    )
    assert [defect.action for defect in wrong_up_axis.repair(lying)[1]] == ["flagged"]
    assert [defect.action for defect in wrong_up_axis.repair(wrong)[1]] == ["repaired"]


# --- mirror


@pytest.mark.parametrize("kind", ["walk", "run"])
def test_a_mirrored_body_is_reflected(moving: Moving, kind: str) -> None:
    clip = moving(90, kind=kind, noise=0.005)
    mirrored = replace(clip, positions=clip.positions * [1.0, -1.0, 1.0])
    repaired, (found,) = mirrored_body.repair(mirrored)
    assert (found.rule, found.count, found.action) == ("mirrored", 90, "repaired")
    assert np.array_equal(repaired.positions, clip.positions)
    euler = replace(mirrored, euler=np.zeros(clip.positions.shape), orders=("ZYX",) * 20)
    same, (found,) = mirrored_body.repair(euler)
    assert same is euler and found.action == "flagged"


def test_knees_alone_show_a_mirror(moving: Moving) -> None:
    """Marker sets of the legs have neither shoulders nor, sometimes, feet."""
    clip = moving(90)
    legs = replace(clip, positions=clip.positions.copy(), states=clip.states.copy())
    for name in ("shoulder_left", "shoulder_right", "foot_left", "foot_right"):
        legs.positions[:, N[name]], legs.states[:, N[name]] = np.nan, 0
    assert mirrored_body.repair(legs)[1] == []
    repaired, (found,) = mirrored_body.repair(replace(legs, positions=legs.positions * [1.0, -1.0, 1.0]))
    assert found.action == "repaired" and found.text.startswith("knees bend forward in")
    np.testing.assert_allclose(repaired.positions, legs.positions)


def test_who_sits_on_the_heels_is_no_mirror_image(moving: Moving) -> None:
    """Knees bent to the utmost say no more than straight ones, and the toes do point backward."""
    clip = moving(60)
    p = clip.positions
    for side in ("left", "right"):
        hip = p[:, N[f"hip_{side}"]].copy()
        p[:, N[f"knee_{side}"]] = hip + np.array([0.42, 0.0, -0.05])
        p[:, N[f"ankle_{side}"]] = hip + np.array([0.02, 0.0, -0.10])
        p[:, N[f"foot_{side}"]] = hip + np.array([-0.12, 0.0, -0.10])
    same, (found,) = mirrored_body.repair(clip)
    assert same is clip and found.action == "flagged" and "heels" in found.text


def test_one_frame_with_feet_does_not_lower_the_bar_for_the_knees(moving: Moving) -> None:
    clip = moving(90)
    wrong = clip.positions * [1.0, -1.0, 1.0]
    p = np.where(np.arange(90)[:, None, None] % 3 < 2, wrong, clip.positions)  # a tracker that hesitates
    for side in ("left", "right"):
        p[1:, N[f"foot_{side}"]] = np.nan
    assert mirrored_body.repair(replace(clip, positions=p))[1] == []


def test_names_of_the_other_side_are_a_mirror_too(moving: Moving, other_side: list[int]) -> None:
    clip = moving(90)
    repaired, (found,) = mirrored_body.repair(replace(clip, positions=clip.positions[:, other_side]))
    assert found.action == "repaired"
    np.testing.assert_allclose(repaired.positions, clip.positions[:, other_side] * [1.0, -1.0, 1.0])
    assert mirrored_body.repair(repaired)[1] == []


# --- limbs


def shortened(clip: Clip, share: float, joint: str, above: str) -> Clip:
    """The bone from `above` to `joint` on both sides at a share of its length, the rest moved along."""
    p = clip.positions.copy()
    for side in ("left", "right"):
        by = (share - 1.0) * (p[:, N[f"{joint}_{side}"]] - p[:, N[f"{above}_{side}"]])
        p[:, N[f"{joint}_{side}"]] += by
        if joint == "ankle":
            p[:, N[f"foot_{side}"]] += by
    return replace(clip, positions=p)


def test_children_pass_and_fused_legs_do_not(moving: Moving) -> None:
    clip = moving(120, noise=0.006)
    for size in (0.6, 0.75, 1.15):
        assert limb_lengths.detect(scaled(moving(120, noise=0.006 * size), size)) == []
    assert limb_lengths.detect(shortened(clip, 0.9, "ankle", "knee")) == []
    fused = shortened(scaled(clip, 0.75), 0.72, "ankle", "knee")
    (found,) = limb_lengths.detect(fused)
    assert (found.rule, found.action) == ("impossible_limbs", "refused")
    assert "times the shank" in found.text


def test_a_child_before_a_noisy_sensor_is_no_machine(moving: Moving) -> None:
    found = limb_lengths.detect(scaled(moving(240, noise=0.045), 0.7))
    assert {defect.rule for defect in found} <= {"bone_drift"}
    assert found == [] or found[0].action == "flagged"


def test_lengths_of_nobody(moving: Moving) -> None:
    (found,) = limb_lengths.detect(shortened(moving(120), 0.4, "ankle", "knee"))
    assert found.action == "refused" and found.count == 2 and "left shank 0.1" in found.text


def test_bones_that_shrink_are_told_with_numbers(moving: Moving) -> None:
    clip = moving(120)
    share = np.linspace(1.0, 0.7, 120)[:, None]
    p = clip.positions.copy()
    p[:, N["elbow_left"]] += (share - 1.0) * (p[:, N["elbow_left"]] - p[:, N["shoulder_left"]])
    found = {defect.rule: defect for defect in limb_lengths.detect(replace(clip, positions=p))}
    drift = found["bone_drift"]
    assert drift.action == "flagged"
    # First and last fifth: medians of 0.97 and 0.73 of a length whose median is 0.85.
    assert "left upper arm" in drift.text and "-28 % over the clip" in drift.text


def test_real_limbs(captures: Path) -> None:
    from kinemimic.pipeline.readers.recognise import read  # noqa: PLC0415 (all readers)

    for name in (
        "kinect2_brekel_bvh/motion1_v.bvh",
        "kinect1_bernstein_skl/i1.skl",
        "shum_gait_bvh/SubjectA1_Cycle1.bvh",
    ):
        assert not [d for d in limb_lengths.detect(read(captures / name)) if d.rule == "impossible_limbs"]


# --- calibration pose


def t_pose(clip: Clip) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    pose = clip.positions[0].copy()
    for side, sign in (("left", 1.0), ("right", -1.0)):
        shoulder = pose[N[f"shoulder_{side}"]]
        for k, joint in enumerate(("elbow", "wrist", "hand"), start=1):
            pose[N[f"{joint}_{side}"]] = shoulder + np.array([0.0, 0.27 * sign * k, 0.0])
        for joint, height in (("knee", -0.42), ("ankle", -0.82), ("foot", -0.85)):
            pose[N[f"{joint}_{side}"]] = pose[N[f"hip_{side}"]] + [0.0, 0.0, height]
    return pose


@pytest.mark.parametrize("frames", [1, 3])
def test_a_calibration_pose_is_dropped(moving: Moving, frames: int) -> None:
    clip = moving(90, noise=0.004)
    broken = replace(clip, positions=clip.positions.copy())
    broken.positions[:frames] = t_pose(clip)
    repaired, (found,) = calibration_frames.repair(broken)
    assert (found.rule, found.count, found.action) == ("calibration_frames", frames, "repaired")
    assert np.array_equal(repaired.positions, clip.positions[frames:])
    assert np.array_equal(repaired.times, clip.times[frames:])


def test_arms_held_out_during_the_motion_are_no_calibration(moving: Moving) -> None:
    clip = moving(90)
    held = (
        clip.positions
        + (t_pose(clip) - clip.positions[0]) * np.isin(np.arange(20), [5, 6, 7, 9, 10, 11])[:, None]
    )
    assert calibration_frames.repair(replace(clip, positions=held))[1] == []
