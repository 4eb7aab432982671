"""Changes lead back to the frames that they were taken from, and do not depend on place and direction."""

from __future__ import annotations

import numpy as np
import pytest
from peers.elsewhere import turned

from kinemimic.pipeline.kinematics.rotations import angle_between
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.prediction.moments import (
    CHANGES,
    FUTURE,
    NOISY_PAST,
    PAST,
    changed,
    changes,
    corrected,
    corrections,
    observations,
    observed,
)
from kinemimic.train.reference.live_reference import AHEAD, KNOWN, MEMORY

FRAMES = max(PAST) + 1


def test_it_fits_the_reference_that_it_is_made_for() -> None:
    assert FUTURE == AHEAD - KNOWN
    assert max(*PAST, *NOISY_PAST) < MEMORY


def test_changes_lead_to_the_frames(motion: Motion) -> None:
    root, rotations = motion.root[:FRAMES], motion.rotations[:FRAMES]
    # A pose from elsewhere in the stride, turned by half a turn and more.
    for turn in (0.0, 2.0, np.pi):
        there = turned(motion, turn)
        found = changes(there.root[:FRAMES], there.rotations[:FRAMES], root[-1], rotations[-1])
        assert found.shape == (FRAMES, CHANGES)
        back = changed(root[-1], rotations[-1], found)
        assert np.allclose(back[0], there.root[:FRAMES], atol=1e-12)
        assert angle_between(back[1], there.rotations[:FRAMES]).max() < 1e-7


@pytest.mark.parametrize("turn", [1.0, -2.5])
def test_place_and_direction_do_not_matter(motion: Motion, turn: float) -> None:
    there = turned(motion, turn)
    moved = there.root + np.array([3.0, -2.0, 0.0])
    seen = observed(motion.root[:FRAMES], motion.rotations[:FRAMES], PAST)
    assert seen.shape == (observations(PAST),)
    assert np.allclose(observed(moved[:FRAMES], there.rotations[:FRAMES], PAST), seen, atol=1e-9)
    # The height above the ground does.
    assert not np.allclose(
        observed(moved[:FRAMES] + np.array([0.0, 0.0, 0.1]), there.rotations[:FRAMES], PAST), seen, atol=0.05
    )


def test_a_batch_is_its_moments(motion: Motion) -> None:
    starts = (0, 4, 9)
    roots = np.array([motion.root[k : k + FRAMES] for k in starts])
    turns = np.array([motion.rotations[k : k + FRAMES] for k in starts])
    one_by_one = [observed(*one, PAST) for one in zip(roots, turns, strict=True)]
    assert np.allclose(observed(roots, turns, PAST), one_by_one)


@pytest.mark.parametrize("turn", [0.0, 2.5])
def test_a_restoration_undoes_noise(motion: Motion, turn: float) -> None:
    """From a frame elsewhere in the stride: pose, height and step are corrected, the place is not."""
    there = turned(motion, turn)
    true_root, true = there.root[4 : 6 + FUTURE], there.rotations[5 : 6 + FUTURE]
    noisy_root, noisy = motion.root[[20, 21]] + [0.2, -0.1, 0.03], motion.rotations[21]
    change = corrections(true_root, true, noisy_root[1], noisy)
    assert change.shape == (1 + FUTURE, CHANGES)
    root, rotations = corrected(noisy_root, noisy, change)
    assert angle_between(rotations, true).max() < 1e-7
    assert np.allclose(root[:, 2], true_root[1:, 2], atol=1e-12)
    place = noisy_root[0, :2] - true_root[0, :2]
    assert np.allclose(root[:, :2] - place, true_root[1:, :2], atol=1e-12)
