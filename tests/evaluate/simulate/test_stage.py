from __future__ import annotations

import numpy as np
import pytest

from kinemimic.evaluate.simulate.effects import slope_tilt
from kinemimic.evaluate.simulate.stage import upright
from kinemimic.pipeline.kinematics.rotations import from_axis_angle, rotate
from kinemimic.train.sim.world import BodyStates


def test_level_ground_is_shown_level() -> None:
    np.testing.assert_array_equal(upright(np.zeros(3)), [0.0, 0.0, 0.0, 1.0])


@pytest.mark.parametrize("slope", [0.1, -0.3])
@pytest.mark.parametrize("heading", [0.0, 1.0, -2.5])
def test_the_way_ahead_is_shown_to_rise_by_the_slope(slope: float, heading: float) -> None:
    turned = np.tile(from_axis_angle("Z", np.array([heading]))[0], (1, 15, 1))
    bodies = BodyStates(np.zeros((1, 15, 3)), turned, np.zeros((1, 15, 3)), np.zeros((1, 15, 3)))
    shown = upright(slope_tilt(bodies, slope))
    ahead = np.array([np.cos(heading), np.sin(heading), 0.0])
    across = np.array([-np.sin(heading), np.cos(heading), 0.0])
    np.testing.assert_allclose(rotate(shown, ahead), [*(np.cos(slope) * ahead[:2]), np.sin(slope)], atol=1e-9)
    np.testing.assert_allclose(rotate(shown, across), across, atol=1e-9)
