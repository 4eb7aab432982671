from __future__ import annotations

import numpy as np
import pytest

from kinemimic.evaluate.simulate.stage import upright
from kinemimic.pipeline.kinematics.rotations import rotate
from kinemimic.train.scenario.event_schedule import slope_tilt


def test_level_ground_is_shown_level() -> None:
    np.testing.assert_array_equal(upright(np.zeros(3)), [0.0, 0.0, 0.0, 1.0])


@pytest.mark.parametrize("slope", [0.1, -0.3])
@pytest.mark.parametrize("heading", [0.0, 1.0, -2.5])
def test_the_way_ahead_is_shown_to_rise_by_the_slope(slope: float, heading: float) -> None:
    shown = upright(slope_tilt(slope, heading))
    ahead = np.array([np.cos(heading), np.sin(heading), 0.0])
    across = np.array([-np.sin(heading), np.cos(heading), 0.0])
    np.testing.assert_allclose(rotate(shown, ahead), [*(np.cos(slope) * ahead[:2]), np.sin(slope)], atol=1e-9)
    np.testing.assert_allclose(rotate(shown, across), across, atol=1e-9)
