from __future__ import annotations

import numpy as np
import pytest

from kinemimic.retarget.optimise.one_sided import OneSided


def test_a_violated_constraint_is_released_gradually():
    ground = OneSided((3,), 0.01)
    every = slice(0, 3)
    assert ground.weight(np.array([0.0, 0.002, 1.0]), every) == pytest.approx([0, 0, 0])
    assert ground.weight(np.array([-0.5, 0.002, 1.0]), every) == pytest.approx([1, 0, 0])
    # Half way to `release` a quarter is left, beyond it nothing.
    assert ground.weight(np.array([0.005, 0.002, 1.0]), every) == pytest.approx([0.25, 0, 0])
    assert ground.weight(np.array([0.02, 0.002, -1e-9]), every) == pytest.approx([0, 0, 1])


def test_windows_share_the_state_of_their_frames():
    ground = OneSided((4,), 1.0)
    ground.weight(np.array([-1.0, 1.0]), slice(2, 4))
    assert ground.weight(np.zeros(4), slice(0, 4)) == pytest.approx([0, 0, 1, 0])
