"""A knee that bends to the front: kept and told of a steady body, counted as flexion of a noisy one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.angles import leg_angles
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.quality.check import check_capture
from kinemimic.pipeline.quality.rules import knee_sign

Build = Callable[..., Clip]
RATE = 100.0


def hyperextending(build: Build, deepest: float) -> tuple[Clip, Array]:
    """A figure whose left knee swings between 60 degrees and `deepest` (negative), and that angle in degrees.

    The shank turns about the hips' line; no bone changes its length.
    """
    clip = build(300, rate=RATE)
    positions = np.broadcast_to(clip.positions[:1], clip.positions.shape).copy()
    phase = 2.0 * np.pi * np.arange(300) / RATE / 1.2
    flexion = 0.5 * (60.0 + deepest) + 0.5 * (60.0 - deepest) * np.sin(phase)
    hip, knee = positions[:, N["hip_left"]], positions[:, N["knee_left"]]
    lateral = positions[0, N["hip_left"]] - positions[0, N["hip_right"]]
    lateral /= np.linalg.norm(lateral)
    thigh = (knee - hip)[0]
    thigh = thigh - (thigh @ lateral) * lateral
    positions[:, N["knee_left"]] = hip + thigh
    for node, length in (("ankle_left", 0.42), ("foot_left", 0.5)):
        angle = np.radians(flexion)[:, None]
        along = thigh / np.linalg.norm(thigh)
        positions[:, N[node]] = (
            hip + thigh + length * (np.cos(angle) * along + np.sin(angle) * np.cross(lateral, along))
        )
    return replace(clip, positions=positions), flexion


@pytest.mark.parametrize("deepest", [-16.0, -20.0, -30.0])
def test_hyperextension_of_a_steady_leg_is_kept_and_told(node_clip: Build, deepest: float) -> None:
    clip, flexion = hyperextending(node_clip, deepest)
    knee = np.degrees(leg_angles(clip.positions)["knee_left"])
    assert np.allclose(knee, flexion, atol=1e-6)
    (found,) = knee_sign.detect(clip)
    assert (found.action, found.count) == ("flagged", int((flexion < -15.0).sum()))
    assert f"left knee to {-deepest:.0f}° in " in found.text


def test_so_is_it_with_the_noise_of_an_optical_system(node_clip: Build) -> None:
    """Half a millimetre per coordinate."""
    clip, flexion = hyperextending(node_clip, -18.0)
    noisy = clip.positions + np.random.default_rng(3).normal(scale=0.0005, size=clip.positions.shape)
    knee = np.degrees(leg_angles(noisy)["knee_left"])
    assert np.abs(knee - flexion).max() < 2.0
    assert [one.action for one in knee_sign.detect(replace(clip, positions=noisy))] == ["flagged"]


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_with_the_noise_of_a_kinect_it_counts_as_flexion_and_that_is_told(
    node_clip: Build, seed: int
) -> None:
    """Two centimetres per coordinate, of knees, ankles and hips."""
    clip, flexion = hyperextending(node_clip, -20.0)
    noisy = clip.positions + np.random.default_rng(seed).normal(scale=0.02, size=clip.positions.shape)
    knee = np.degrees(leg_angles(noisy)["knee_left"])
    assert knee.min() > -15.0
    assert np.median(np.abs(knee[flexion < -15.0] - np.abs(flexion[flexion < -15.0]))) < 8.0
    (found,) = knee_sign.detect(replace(clip, positions=noisy))
    assert found.action == "repaired" and "counted as flexion" in found.text


def test_no_knee_goes_further_however_steady_the_sensor(node_clip: Build) -> None:
    clip, flexion = hyperextending(node_clip, -50.0)
    assert np.allclose(np.degrees(leg_angles(clip.positions)["knee_left"]), np.abs(flexion), atol=1e-6)
    assert [one.action for one in knee_sign.detect(clip)] == ["repaired"]


def test_a_leg_that_never_moves_shows_no_steadiness(node_clip: Build) -> None:
    clip, _ = hyperextending(node_clip, -20.0)
    still = replace(clip, positions=np.broadcast_to(clip.positions[89:90], clip.positions.shape).copy())
    assert np.degrees(leg_angles(still.positions)["knee_left"]).min() > 15.0


def test_the_finding_reaches_the_report(node_clip: Build) -> None:
    clip, _ = hyperextending(node_clip, -20.0)
    clip = replace(clip, provenance={"reading": {"defects": [], "notes": []}})
    assert "knee_sign" in {one.rule for one in check_capture(clip).defects}
