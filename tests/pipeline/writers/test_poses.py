"""Clips as poses: joints keep their positions, times become regular, gaps are interpolated and counted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from samples.motion import RigidWalk, rigid_walk, seen_clip, walk

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import angle_between
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.writers.poses import Poses, poses_of_clip

SHOWN = rigid_walk(60, 60.0)


def of_rotations(shown: RigidWalk = SHOWN) -> Clip:
    return Poses.rigid(shown.skeleton, 60.0, shown.root, shown.rotations).clip()


def of_positions(frames: int = 60) -> Clip:
    """What a sensor sees: joints whose distances change."""
    return seen_clip(walk(frames).joints)


def test_a_rigid_skeleton_comes_back_with_its_offsets() -> None:
    poses = poses_of_clip(of_rotations())
    assert poses.rate == pytest.approx(60.0)
    assert poses.filled == 0
    np.testing.assert_array_equal(poses.skeleton.offsets, SHOWN.skeleton.offsets)
    np.testing.assert_allclose(poses.kinematics()[0], SHOWN.joints, atol=1e-12)
    np.testing.assert_allclose(poses.clip().positions, SHOWN.joints, atol=1e-12)


def test_captured_positions_are_kept_although_bones_change_their_lengths() -> None:
    clip = of_positions()
    poses = poses_of_clip(clip)
    np.testing.assert_allclose(poses.kinematics()[0], clip.positions, atol=1e-12)
    lengths = np.linalg.norm(np.diff(clip.positions[:, [12, 13]], axis=1)[:, 0], axis=-1)
    assert np.linalg.norm(poses.skeleton.offsets[13]) == pytest.approx(np.median(lengths), abs=1e-3)


def test_gaps_are_interpolated_ends_are_held_and_both_are_counted() -> None:
    clip = of_positions()
    knee, head = NODE_INDEX["knee_left"], NODE_INDEX["head"]
    positions, rotations = clip.positions.copy(), np.array(clip.rotations)
    positions[20:23, knee], rotations[20:23, knee] = np.nan, np.nan
    positions[:5, head] = np.nan
    poses = poses_of_clip(replace(clip, positions=positions, rotations=rotations))
    assert poses.filled == 3 + 5
    found, _ = poses.kinematics()
    np.testing.assert_allclose(found[20:23, knee], clip.positions[20:23, knee], atol=0.02)
    np.testing.assert_allclose(found[:5, head], np.tile(clip.positions[5, head], (5, 1)), atol=1e-12)


def test_a_joint_that_was_never_seen_stays_at_its_parent() -> None:
    clip = of_positions()
    hand, wrist = NODE_INDEX["hand_left"], NODE_INDEX["wrist_left"]
    positions, rotations = clip.positions.copy(), np.array(clip.rotations)
    positions[:, hand], rotations[:, hand] = np.nan, np.nan
    found, _ = poses_of_clip(replace(clip, positions=positions, rotations=rotations)).kinematics()
    np.testing.assert_allclose(found[:, hand], found[:, wrist], atol=1e-12)


def test_irregular_times_become_regular() -> None:
    clip = of_rotations()
    kept = np.delete(np.arange(60), [11, 30, 31])
    assert clip.rotations is not None and clip.translations is not None
    gappy = replace(
        clip,
        times=clip.times[kept],
        positions=clip.positions[kept],
        states=clip.states[kept],
        passes=clip.passes[kept],
        rotations=clip.rotations[kept],
        translations=clip.translations[kept],
    )
    poses = poses_of_clip(gappy)
    assert (len(poses.rotations), poses.rate) == (60, pytest.approx(60.0))
    assert np.degrees(angle_between(poses.rotations, SHOWN.rotations).max()) < 1.0
    np.testing.assert_allclose(poses.kinematics()[0], SHOWN.joints, atol=0.01)
    bone = poses.translations[:, 1:] - SHOWN.skeleton.offsets[1:]
    assert np.abs(bone).max() < 1e-12, "interpolation keeps rigid bones rigid"


def test_one_frame_is_refused() -> None:
    clip = of_rotations(rigid_walk(1, 60.0))
    with pytest.raises(KinemimicError, match="2 frames or more, found 1"):
        poses_of_clip(clip)
