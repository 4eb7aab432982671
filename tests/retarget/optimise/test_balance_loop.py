from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from peers.trackers import shipped_motion

from kinemimic.retarget.feet.contact import sole_positions
from kinemimic.retarget.feet.zero_moment_point import Balance, distance_from_soles
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.optimise.balance_loop import balance_loop
from kinemimic.retarget.optimise.refine import refine


@pytest.fixture(scope="module")
def swaying() -> Motion:
    """A walk with more sway than the feet allow."""
    walk = shipped_motion("walk")
    phase = np.arange(len(walk.root)) / len(walk.root)
    sway = np.outer(np.sin(2.0 * np.pi * phase), [0.0, 0.03, 0.0])
    return refine(replace(walk, root=walk.root + sway))


@pytest.mark.parametrize("refined", [True, False])
def test_the_distance_is_that_of_the_loop_that_comes_out(swaying: Motion, refined: bool) -> None:
    found, balance = balance_loop(swaying, refined=refined)
    assert balance is not None
    assert balance.outside == pytest.approx(distance_from_soles(found))
    assert balance.outside_before == pytest.approx(distance_from_soles(swaying))
    assert balance.outside < balance.outside_before
    # The soles that are in contact stay in place, to some millimetres.
    moved = np.linalg.norm(
        sole_positions(*found.kinematics()) - sole_positions(*swaying.kinematics()), axis=-1
    )
    assert np.median(moved[swaying.contacts]) < 0.005
    np.testing.assert_array_equal(found.contacts, swaying.contacts)


def test_a_loop_that_comes_no_nearer_stays_as_it_is(swaying: Motion, monkeypatch: pytest.MonkeyPatch) -> None:
    def worse(motion: Motion) -> tuple[Motion, Balance]:
        phase = np.arange(len(motion.root)) / len(motion.root)
        away = np.outer(np.sin(2.0 * np.pi * phase), [0.0, 0.05, 0.0])
        before = distance_from_soles(motion)
        return replace(motion, root=motion.root + away), Balance(0.0, before, 0.05)

    monkeypatch.setattr("kinemimic.retarget.optimise.balance_loop.balanced", worse)
    assert balance_loop(swaying) == (swaying, None)


def test_a_loop_that_cannot_be_balanced_stays_as_it_is(swaying: Motion) -> None:
    flying = replace(swaying, root=swaying.root + np.array([0.0, 0.0, 0.5]))
    assert distance_from_soles(flying) == np.inf
    assert balance_loop(flying) == (flying, None)
