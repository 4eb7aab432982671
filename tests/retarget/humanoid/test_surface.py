"""The body's lowest points, by Table 1's dimensions."""

from __future__ import annotations

import numpy as np
import pytest

from kinemimic.pipeline.kinematics.rotations import IDENTITY, from_axis_angle
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.retarget.feet.scale import body_kinematics
from kinemimic.retarget.humanoid.body import BODY_INDEX, STANDING_HEIGHT
from kinemimic.retarget.humanoid.surface import lowest_points


def heights(rotations: np.ndarray, root: np.ndarray) -> np.ndarray:
    return lowest_points(*body_kinematics(rotations[None], root[None]))[0, :, 2]


def test_upright_the_soles_are_lowest_and_at_the_ground():
    found = heights(np.tile(IDENTITY, (20, 1)), np.array([0.0, 0.0, STANDING_HEIGHT]))
    assert found[[BODY_INDEX["foot_left"], BODY_INDEX["foot_right"]]] == pytest.approx(0.0, abs=1e-12)
    # The shin's capsule ends at the ankle, 5 cm over the sole; the pelvis is 15 cm high about the hip centre.
    assert found[BODY_INDEX["shin_left"]] == pytest.approx(0.05)
    assert found[BODY_INDEX["pelvis"]] == pytest.approx(STANDING_HEIGHT - 0.075)
    assert found.min() == pytest.approx(0.0, abs=1e-12)


def test_lying_on_the_back_the_pelvis_is_half_its_depth_below_its_centre():
    q = np.tile(IDENTITY, (20, 1))
    q[N["hip_center"]] = from_axis_angle("Y", np.array(-np.pi / 2))
    found = heights(q, np.array([0.0, 0.0, 1.0]))
    assert found[BODY_INDEX["pelvis"]] == pytest.approx(1.0 - 0.06)
    assert found[BODY_INDEX["torso"]] == pytest.approx(1.0 - 0.05)
    assert found[BODY_INDEX["head"]] == pytest.approx(1.0 - 0.075)
    # A capsule's side is its radius away: a thigh's 5 cm, a shin's 4 cm.
    assert found[BODY_INDEX["thigh_left"]] == pytest.approx(1.0 - 0.05)
    assert found[BODY_INDEX["shin_right"]] == pytest.approx(1.0 - 0.04)
