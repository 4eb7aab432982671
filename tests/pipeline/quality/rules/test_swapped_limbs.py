"""Swapped limbs."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import IDENTITY
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import NODES, Skeleton
from kinemimic.pipeline.quality.passes import find_passes, with_passes
from kinemimic.pipeline.quality.rules import swapped_limbs
from kinemimic.pipeline.quality.rules.swap_sides import opposite_sides
from kinemimic.pipeline.readers.recognise import read
from kinemimic.pipeline.virtual_kinect.recorder import record_virtual

Moving = Callable[..., Clip]
NOISE = 0.008  # metres: a Kinect v1's at knees and ankles


def swap_limbs(clip: Clip, frames: list[int], joints: tuple[str, ...]) -> Clip:
    positions = clip.positions.copy()
    left, right = ([N[f"{joint}_{side}"] for joint in joints] for side in ("left", "right"))
    rows = np.array(frames)[:, None]
    positions[rows, left + right] = clip.positions[rows, right + left]
    return replace(clip, positions=positions)


@pytest.mark.parametrize("kind", ["walk", "run"])
@pytest.mark.parametrize("noise", [0.0, NOISE])
def test_a_sound_motion_has_none(moving: Moving, kind: str, noise: float) -> None:
    clip = moving(300, kind=kind, noise=noise)
    assert swapped_limbs.repair(clip) == (clip, [])


@pytest.mark.parametrize("kind", ["walk", "run"])
@pytest.mark.parametrize("limb", swapped_limbs.LIMBS)
@pytest.mark.parametrize("attached_to", [(), ("hip", "shoulder")])
def test_swapped_limbs_are_swapped_back(
    moving: Moving, kind: str, limb: str, attached_to: tuple[str, ...]
) -> None:
    """With the joint that the limb is attached to, or without it."""
    clip = moving(300, kind=kind, noise=NOISE)
    frames = [40, 41, 100, 180, 181, 182, 183, 184, 240]
    joints = swapped_limbs.LIMBS[limb] + attached_to[{"legs": 0, "arms": 1}[limb] :][:1]
    repaired, (found,) = swapped_limbs.repair(swap_limbs(clip, frames, joints))
    assert np.array_equal(repaired.positions, clip.positions)
    assert (found.rule, found.count, found.action) == ("swapped_sides", 9, "repaired")
    assert found.frames == ((40, 41), (100, 100), (180, 184), (240, 240))
    assert f"{limb} in 9 frames (4 times)" in found.text


def test_all_that_belongs_to_a_limb_goes_with_it(moving: Moving) -> None:
    """Tips and thumbs, recorded angles, and recorded rotations, which cannot be repaired."""
    clip = moving(120, noise=NOISE)
    tips = clip.positions[:, [N["hand_left"], N["hand_right"]]] + [0.0, 0.0, -0.05]
    names = tuple(
        f"{node.split('_')[1][0]}_{node.split('_')[0]}" if node.endswith(("_left", "_right")) else node
        for node in NODES
    )
    parents = (*clip.skeleton.parents, N["hand_left"], N["hand_right"])
    whole = replace(
        clip,
        skeleton=Skeleton((*names, "l_tip", "r_tip"), parents, np.zeros((22, 3))),
        positions=np.concatenate([clip.positions, tips], axis=1),
        states=np.concatenate([clip.states, clip.states[:, :2]], axis=1),
        rotations=np.tile(IDENTITY, (120, 22, 1)),
        angles={"knee_left": np.zeros(120), "knee_right": np.ones(120), "elbow_left": np.full(120, 2.0),
                "elbow_right": np.full(120, 3.0)},
    )  # fmt: skip
    wrong = whole.positions.copy()
    limb = [N[f"{joint}_{side}"] for joint in swapped_limbs.LIMBS["arms"] for side in ("left", "right")] + [
        20,
        21,
    ]
    there = [joint ^ 1 if joint >= 20 else limb[limb.index(joint) ^ 1] for joint in limb]
    wrong[np.ix_([60, 61], limb)] = whole.positions[np.ix_([60, 61], there)]
    repaired, (found,) = swapped_limbs.repair(replace(whole, positions=wrong))
    assert found.frames == ((60, 61),) and np.array_equal(repaired.positions, whole.positions)
    assert repaired.angles is not None and repaired.rotations is not None
    assert np.flatnonzero(repaired.angles["elbow_left"] == 3.0).tolist() == [60, 61]
    assert np.flatnonzero(repaired.angles["elbow_right"] == 2.0).tolist() == [60, 61]
    assert not repaired.angles["knee_left"].any() and repaired.angles["knee_right"].all()
    unknown = np.zeros((120, 22), dtype=np.bool_)
    unknown[np.ix_([60, 61], limb)] = True
    assert np.array_equal(np.isnan(repaired.rotations).any(axis=-1), unknown)


def test_at_the_ends_and_the_majority(moving: Moving) -> None:
    """The first frames, the last ones, and a pass that is right for less than half of its time."""
    clip = moving(120, noise=NOISE)
    repaired, (found,) = swapped_limbs.repair(
        swap_limbs(clip, [0, 1, 117, 118, 119], swapped_limbs.LIMBS["legs"])
    )
    assert np.array_equal(repaired.positions, clip.positions)
    assert found.frames == ((0, 1), (117, 119))
    # What is so most of the time is taken for right: the names of the whole pass are not for this rule.
    mostly = [frame for frame in range(120) if frame not in (50, 51)]
    repaired, (found,) = swapped_limbs.repair(swap_limbs(clip, mostly, swapped_limbs.LIMBS["legs"]))
    assert found.frames == ((50, 51),)


def test_missing_joints_do_not_disturb(moving: Moving) -> None:
    clip = moving(120, noise=NOISE)
    clip.positions[::7, N["ankle_left"]] = np.nan
    broken = swap_limbs(clip, [60, 61], swapped_limbs.LIMBS["legs"])
    assert np.array_equal(swapped_limbs.repair(broken)[0].positions, clip.positions, equal_nan=True)


def test_euler_captures_are_flagged(moving: Moving) -> None:
    clip = swap_limbs(moving(120), [60, 61], swapped_limbs.LIMBS["legs"])
    euler = replace(clip, euler=np.zeros(clip.positions.shape), orders=("ZYX",) * 20)
    same, (found,) = swapped_limbs.repair(euler)
    assert same is euler and found.action == "flagged" and found.count == 2


def test_recall_and_precision_on_the_virtual_kinect(tmp_path: Path) -> None:
    """With noise, gaps and outliers: recall and precision of swapped frames are 0.8; most of the other frames
    are at the start and end of a pass."""
    true = found = hit = 0
    for seed in range(8):
        capture = record_virtual(tmp_path / str(seed), seed=seed).skl
        clip = read(capture)
        clip = with_passes(clip, find_passes(clip))
        note = json.loads(capture.with_suffix(".provenance.json").read_text(encoding="utf-8"))
        swapped = np.zeros(len(clip.times), dtype=np.bool_)
        swapped[note["swapped"]] = True
        detected = np.zeros(len(clip.times), dtype=np.bool_)
        for defect in swapped_limbs.repair(clip)[1]:
            for first, last in defect.frames:
                detected[first : last + 1] = True
        true, found, hit = true + swapped.sum(), found + detected.sum(), hit + (swapped & detected).sum()
    assert true > 30
    assert hit >= 0.8 * true and hit >= 0.8 * found


def test_the_side_may_be_in_the_middle_of_a_name() -> None:
    bones = ("Thigh", "Calf", "Foot")
    names = ("Bip01 Pelvis", *(f"Bip01 {side} {bone}" for side in "LR" for bone in bones))
    assert opposite_sides(names) == [0, 4, 5, 6, 1, 2, 3]
