"""Contact detection, stances across the seam, anchors of rigid feet."""

from __future__ import annotations

import numpy as np
import pytest

from kinemimic.retarget.feet.contact import (
    RECORDED_THRESHOLDS,
    ContactThresholds,
    contact_speeds,
    detect_contacts,
    find_stances,
)
from kinemimic.retarget.humanoid.body import sole_corners

WHEN = ContactThresholds(near=0.02, far=0.04, slow=0.2, fast=0.4)
RATE = 60.0


def feet(height, speed=0.0):
    """The same for both feet."""
    both = np.repeat(np.asarray(height, dtype=float)[:, None], 2, axis=1)
    return both, np.broadcast_to(speed, both.shape)


def test_contact_lasts_until_the_foot_is_above_the_far_threshold():
    height, speed = feet([0.05, 0.03, 0.03, 0.01, 0.03, 0.03, 0.05, 0.03, 0.03, 0.03])
    found = detect_contacts(height, speed, WHEN, rate=RATE, cyclic=False)
    # The first run touches the ground once and counts whole; the last never does.
    assert found[:, 0].tolist() == [False, True, True, True, True, True, False, False, False, False]


def test_noise_around_a_threshold_does_not_end_contact():
    rng = np.random.default_rng(0)
    height, speed = feet(RECORDED_THRESHOLDS.near + 0.01 * rng.standard_normal(200))
    assert detect_contacts(height, speed, RECORDED_THRESHOLDS, rate=RATE, cyclic=False)[:, 0].all()


def test_a_foot_that_swings_low_or_stops_in_the_air_is_not_in_contact():
    passing = detect_contacts(*feet(np.full(30, 0.01), 1.0), WHEN, rate=RATE, cyclic=False)
    hanging = detect_contacts(*feet(np.full(30, 0.2), 0.0), WHEN, rate=RATE, cyclic=False)
    brief = detect_contacts(*feet([0.1] * 5 + [0.0] * 2 + [0.1] * 5), WHEN, rate=RATE, cyclic=False)
    assert not passing.any() and not hanging.any() and not brief.any()


def test_a_stance_across_the_seam_of_a_cycle_is_a_single_stance():
    height, speed = feet([0.01] * 4 + [0.1] * 10 + [0.03] * 6)
    assert detect_contacts(height, speed, WHEN, rate=RATE, cyclic=True)[:, 0].sum() == 10
    stands = detect_contacts(height, speed, WHEN, rate=RATE, cyclic=True)
    found = find_stances(stands, flat_feet(20, np.zeros((20, 2))), rate=RATE, cyclic=True)
    assert set(found.number[stands[:, 0], 0]) == {1} and set(found.number[stands[:, 1], 1]) == {2}
    assert found.cycles[:4, 0].tolist() == [1.0] * 4 and not found.cycles[14:, 0].any()


def flat_feet(frames, place, heading=0.0):
    """Sole corners (T, 2, 4, 3) of flat feet at places (T, 2)."""
    c, s = np.cos(heading), np.sin(heading)
    sole = sole_corners()[:, :2] @ np.array([[c, s], [-s, c]])
    out = np.zeros((frames, 2, 4, 3))
    out[..., :2] = sole + place[:, None, None, :]
    return out


def test_a_sliding_foot_is_anchored_at_its_mean_position_as_a_rigid_sole():
    slide = np.stack([np.linspace(0.0, 0.04, 21), np.zeros(21)], axis=-1)
    corners = flat_feet(21, slide, heading=0.3)
    # First the heel carries, then the toes.
    corners[:7, :, 2:, 2], corners[14:, :, :2, 2] = 0.05, 0.05
    stands = np.ones((21, 2), dtype=bool)
    anchors = find_stances(stands, corners, rate=RATE, cyclic=False).anchors(corners, np.zeros(3))
    middle = flat_feet(21, np.tile([0.02, 0.0], (21, 1)), heading=0.3)[..., :2]
    size = np.linalg.norm(anchors[0, 0, 0] - anchors[0, 0, 3])
    assert size == pytest.approx(np.linalg.norm(middle[0, 0, 0] - middle[0, 0, 3]))
    assert (anchors == anchors[0]).all()
    assert anchors == pytest.approx(middle, abs=0.006)


def test_anchors_of_a_cycle_advance_with_it():
    frames, advance = 20, np.array([1.2, 0.0, 0.0])
    place = np.zeros((frames, 2))
    place[14:, 0] = 1.2  # lands again at the end of the cycle, where the next one begins
    stands = np.zeros((frames, 2), dtype=bool)
    stands[:4] = stands[14:] = True
    corners = flat_feet(frames, place)
    anchors = find_stances(stands, corners, rate=RATE, cyclic=True).anchors(corners, advance)
    assert anchors[stands] == pytest.approx(corners[..., :2][stands])


def test_contact_speeds_are_between_consecutive_frames_of_contact():
    frames = 11
    place = np.stack([np.where(np.arange(frames) < 6, 0.0, 1.0), np.zeros(frames)], axis=-1)
    stands = np.zeros((frames, 2), dtype=bool)
    stands[:6, 0] = stands[6:, 1] = True
    assert contact_speeds(flat_feet(frames, place), stands, RATE, None) == pytest.approx(np.zeros(5 + 4))
    drift = np.stack([0.001 * np.arange(frames), np.zeros(frames)], axis=-1)
    assert contact_speeds(flat_feet(frames, drift), stands, RATE, None) == pytest.approx(np.full(9, 0.06))
