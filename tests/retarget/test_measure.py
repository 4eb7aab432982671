"""Measures against known errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from kinemimic.pipeline.kinematics.rotations import IDENTITY, from_axis_angle
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.retarget.humanoid.body import STANDING_HEIGHT
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.measure import measure

FRAMES, RATE = 31, 30.0


@pytest.fixture
def standing() -> Motion:
    root = np.tile([0.0, 0.0, STANDING_HEIGHT], (FRAMES, 1))
    rotations = np.tile(IDENTITY, (FRAMES, 20, 1))
    return Motion(RATE, root, rotations, np.ones((FRAMES, 2), dtype=bool), cyclic=False)


PHASE = np.linspace(0.0, 1.0, FRAMES)


def test_the_measures_of_quiet_standing_are_zero(standing):
    found = measure(standing, standing.kinematics()[0], PHASE)
    assert found.foot_speed == found.node_error == pytest.approx(0.0, abs=1e-12)
    assert found.penetration == pytest.approx(0.0, abs=1e-12)
    assert found.floating == pytest.approx(0.0, abs=1e-12)
    assert found.beyond == {}


def test_slip_penetration_and_floating_are_measured(standing):
    along = np.outer(np.arange(FRAMES) / RATE, [0.3, 0.4, 0.0])
    up = np.zeros((FRAMES, 3))
    up[5, 2], up[9, 2] = -0.012, 0.02
    recorded = standing.kinematics()[0]
    found = measure(replace(standing, root=standing.root + along + up), recorded, PHASE)
    assert found.foot_speed == pytest.approx(0.5)
    assert found.penetration == pytest.approx(0.012) and found.floating == pytest.approx(0.02)


def test_a_person_of_another_size_in_the_same_pose_is_no_error(standing):
    found = measure(standing, 1.3 * standing.kinematics()[0] + [4.0, 1.0, 0.2], PHASE)
    assert found.node_error == pytest.approx(0.0, abs=1e-9)


def test_one_turned_shank_moves_one_of_twelve_nodes(standing):
    q = standing.rotations.copy()
    q[:, N["knee_left"]] = from_axis_angle("Y", np.full(FRAMES, np.pi / 3))
    recorded = replace(standing, rotations=q).kinematics()[0]
    # The ankle, 38 cm from the knee, by 60 degrees: its chord is 38 cm. The foot does not count.
    assert measure(standing, recorded, PHASE).node_error == pytest.approx(0.38 / 12)


def test_missing_nodes_are_left_out(standing):
    recorded = standing.kinematics()[0].copy()
    recorded[3:8, N["wrist_left"]] = np.nan
    assert measure(standing, recorded, PHASE).node_error == pytest.approx(0.0, abs=1e-9)
