"""The score of the last seconds of a session."""

from __future__ import annotations

import numpy as np
import pytest

from kinemimic.evaluate.simulate.session.score_window import speed_ratio


def test_a_humanoid_that_walks_backward_has_a_negative_speed() -> None:
    ahead, back, aside = (np.array([x, y]) for x, y in ((0.04, 0.0), (-0.04, 0.0), (0.0, 0.04)))
    for went, wanted in ((ahead, 1.0), (back, -1.0), (aside, 0.0)):
        assert speed_ratio(np.array([[went, ahead]] * 60)) == pytest.approx(wanted)
    there_and_back = np.array([[ahead, ahead]] * 30 + [[back, back]] * 28)
    assert np.isnan(speed_ratio(there_and_back))
