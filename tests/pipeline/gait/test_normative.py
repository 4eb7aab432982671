from __future__ import annotations

import numpy as np
import pytest

from kinemimic.pipeline.gait.normative import FOOT_OFF, NORMATIVE_JOINTS, normative_band

PHASE = np.linspace(0.0, 1.0, 201)


@pytest.mark.parametrize("joint", NORMATIVE_JOINTS)
def test_a_band_closes_and_has_a_width(joint):
    mean, spread = normative_band(joint, PHASE)
    assert mean[0] == mean[-1]
    assert np.degrees(spread).min() > 3
    assert np.degrees(spread).max() < 10
    again = normative_band(joint, PHASE + 3.0)[0]
    assert again == pytest.approx(mean, abs=1e-9)
    # A step of half a per cent of the cycle, 5 ms, is small: no number of the tables is out of line.
    assert np.degrees(np.abs(np.diff(mean))).max() < 2.0
    assert np.degrees(np.abs(np.diff(mean, 4, axis=0)[::4])).max() < 4.0


def test_the_curves_are_those_of_walking():
    """Textbook features of the three joints, in degrees and parts of the cycle."""
    curves = {joint: np.degrees(normative_band(joint, PHASE)[0]) for joint in NORMATIVE_JOINTS}
    knee, hip, ankle = (curves[joint] for joint in ("knee", "hip", "ankle"))
    assert 55 < knee.max() < 65
    assert 0.70 < PHASE[knee.argmax()] < 0.75
    stance = PHASE < 0.4
    assert 15 < knee[stance].max() < 22  # the knee yields while the weight comes on
    assert 0.10 < PHASE[stance][knee[stance].argmax()] < 0.18
    assert 0.48 < PHASE[hip.argmin()] < 0.56  # the hip is most extended as the other foot lands
    assert -20 < hip.min() < -10
    assert 20 < hip.max() < 30
    assert 8 < ankle.max() < 15  # the shank turns over the foot …
    assert 0.40 < PHASE[ankle.argmax()] < 0.50
    assert -25 < ankle.min() < -15  # … and the foot pushes off
    assert abs(PHASE[ankle.argmin()] - FOOT_OFF) < 0.06
