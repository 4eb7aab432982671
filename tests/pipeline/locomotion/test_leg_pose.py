"""Legs that no walker has: missing, stretched, or bent too far."""

from __future__ import annotations

import numpy as np
import pytest
from samples.walker import hips, walker

from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.locomotion.leg_pose import impossible_legs, leg_bones


def test_bones_of_the_walker() -> None:
    w = walker(size=1.1)
    assert leg_bones(w.clip.positions) == pytest.approx(1.1 * np.tile([0.40, 0.38], (len(w.clip.times), 2)))


def test_a_walk_has_possible_legs_and_a_broken_leg_is_found_on_its_side() -> None:
    positions = walker().clip.positions
    p = positions - hips(positions)
    bones = np.median(leg_bones(p), axis=0)
    assert not impossible_legs(p, bones, running=False).any()
    stretched, missing, kicked = p.copy(), p.copy(), p.copy()
    stretched[40:50, N["ankle_left"], 2] -= 0.3
    missing[40:50, N["knee_left"]] = np.nan
    # A thigh that points up.
    kicked[40:50, N["knee_left"]] = kicked[40:50, N["hip_left"]] + [0.2, 0.0, 0.38]
    kicked[40:50, N["ankle_left"]] = kicked[40:50, N["knee_left"]] + [0.2, 0.0, 0.36]
    for broken in (stretched, missing, kicked):
        bad = impossible_legs(broken, bones, running=False)
        assert bad[40:50, 0].all() and bad.sum() == 10


def test_a_bent_knee_is_a_tracking_error_only_where_bones_change_their_length() -> None:
    positions = walker().clip.positions
    p = positions - hips(positions)
    bones = np.median(leg_bones(p), axis=0)
    # A knee of 96 degrees, as in the swing of a walker who crouches.
    thigh, shank = (0.44, np.radians(50.0)), (0.418, np.radians(-46.0))
    p[:, N["knee_left"]] = p[:, N["hip_left"]] + thigh[0] * np.array([np.sin(thigh[1]), 0, -np.cos(thigh[1])])
    p[:, N["ankle_left"]] = p[:, N["knee_left"]] + shank[0] * np.array(
        [np.sin(shank[1]), 0, -np.cos(shank[1])]
    )
    assert impossible_legs(p, bones, running=False)[:, 0].all()
    assert not impossible_legs(p, bones, running=False, precise=True).any()
