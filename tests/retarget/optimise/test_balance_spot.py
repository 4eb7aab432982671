from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from kinemimic.pipeline.kinematics.rotations import from_axis_angle, multiply
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import NODES
from kinemimic.retarget.feet.balance import centre_of_mass
from kinemimic.retarget.feet.contact import sole_positions
from kinemimic.retarget.feet.zero_moment_point import zero_moment_point
from kinemimic.retarget.humanoid.body import STANDING_HEIGHT
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.optimise.balance_spot import LARGEST, balance_spot
from kinemimic.retarget.optimise.refine import refine

FRAMES, RATE = 180, 60.0
SEEN = np.ones((FRAMES, len(NODES)))


@pytest.fixture(scope="module")
def bending() -> Motion:
    """Someone who bends the trunk by 60° and comes up again, without moving the hips back."""
    rotations = np.tile([0.0, 0.0, 0.0, 1.0], (FRAMES, len(NODES), 1))
    bend = np.radians(60.0) * np.sin(np.pi * np.arange(FRAMES) / (FRAMES - 1)) ** 2
    rotations[:, N["spine"]] = multiply(rotations[:, N["spine"]], from_axis_angle("Y", bend))
    knees = np.broadcast_to(np.radians(10.0), FRAMES)
    for side in ("left", "right"):
        for joint, share in (("hip", -0.5), ("knee", 1.0), ("ankle", -0.5)):
            rotations[:, N[f"{joint}_{side}"]] = from_axis_angle("Y", share * knees)
    root = np.tile([0.0, 0.0, STANDING_HEIGHT], (FRAMES, 1))
    contacts = np.ones((FRAMES, 2), dtype=np.bool_)
    return refine(Motion(RATE, root, rotations, contacts, cyclic=False), SEEN)


def ahead_of_ankles(motion: Motion) -> np.ndarray:
    """How far the centre of mass is ahead of the ankles, (T,) m."""
    positions, frames = motion.kinematics()
    ankles = positions[:, [N["ankle_left"], N["ankle_right"]], 0].mean(axis=1)
    return np.asarray(centre_of_mass(positions, frames)[:, 0] - ankles)


@pytest.mark.parametrize("refined", [True, False])
def test_the_hips_go_back_while_the_trunk_bends(bending: Motion, refined: bool) -> None:
    found, balance = balance_spot(bending, SEEN, refined=refined)
    assert balance is not None
    assert balance.outside < 0.6 * balance.outside_before
    assert 0.02 < balance.displacement < np.sqrt(2.0) * LARGEST + 1e-9
    # The bend moves the centre of mass forward by most of a foot's half; less of it remains.
    assert ahead_of_ankles(bending).max() > 0.06
    assert ahead_of_ankles(found).max() < ahead_of_ankles(bending).max() - 0.02
    moved = np.linalg.norm(np.diff(sole_positions(*found.kinematics())[:, :, 0], axis=0), axis=-1)
    assert moved.max() * RATE < 0.1  # m/s: the soles stay in place
    np.testing.assert_allclose(found.root[0, :2], 0.0, atol=1e-3)
    np.testing.assert_array_equal(found.contacts, bending.contacts)


def test_a_motion_and_its_reverse_have_the_same_zero_moment_point(bending: Motion) -> None:
    loop = replace(
        bending,
        root=np.concatenate([bending.root, bending.root[::-1]]),
        rotations=np.concatenate([bending.rotations, bending.rotations[::-1]]),
        contacts=np.concatenate([bending.contacts, bending.contacts[::-1]]),
        cyclic=True,
    )
    point = zero_moment_point(loop, 12)
    np.testing.assert_allclose(point, point[::-1], atol=1e-6)


def test_who_is_balanced_is_left_alone(bending: Motion) -> None:
    once, first = balance_spot(bending, SEEN, refined=False)
    again, second = balance_spot(once, SEEN, refined=False)
    assert first is not None
    assert second is None or second.displacement < 0.25 * first.displacement
    np.testing.assert_allclose(again.root, once.root, atol=0.01)


def test_in_the_air_nothing_changes(bending: Motion) -> None:
    flying = replace(bending, root=bending.root + np.array([0.0, 0.0, 0.5]))
    assert balance_spot(flying, SEEN) == (flying, None)


def test_a_long_motion_is_left_alone(bending: Motion, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("kinemimic.retarget.optimise.balance_spot.LONGEST", bending.duration - 0.1)
    assert balance_spot(bending, SEEN) == (bending, None)
