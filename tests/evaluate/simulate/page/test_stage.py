from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from kinemimic.evaluate.simulate.page.stage import _without_drag, upright
from kinemimic.pipeline.kinematics.rotations import rotate
from kinemimic.retarget.humanoid.body import BODY_INDEX
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


def test_a_push_and_a_drag_of_one_body_leave_the_arrow_of_the_push() -> None:
    torso = BODY_INDEX["torso"]
    loads, drag = np.zeros((15, 3)), np.zeros((3, 3))
    loads[torso], drag[2] = [300.0, 0.0, 0.0], [100.0, 0.0, 0.0]
    frame: Any = SimpleNamespace(loads=loads, torques=np.zeros((15, 3)), drag=drag, dragged=torso)
    forces, _ = _without_drag(frame)
    assert np.flatnonzero(forces.any(axis=-1)).tolist() == [torso]
    np.testing.assert_array_equal(forces[torso], [200.0, 0.0, 0.0])
