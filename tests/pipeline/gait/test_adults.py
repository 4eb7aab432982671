"""The four adults' curves and parameters: consistent with each other, and walks of people."""

import numpy as np
import pytest

from kinemimic.pipeline.gait.adults import NORMALISED, PARAMETERS, RANGES_DEG, adult_band
from kinemimic.pipeline.gait.normative import NORMATIVE_JOINTS, normative_band

PHASE = np.arange(100) / 100.0


@pytest.mark.parametrize("joint", NORMATIVE_JOINTS)
def test_curves_are_closed_and_of_the_shape_of_the_childrens(joint):
    mean, spread = adult_band(joint, PHASE)
    assert np.abs(np.diff(np.degrees(mean), append=np.degrees(mean[0]))).max() < 6.0 and (spread > 0.0).all()
    assert np.corrcoef(mean, normative_band(joint, PHASE)[0])[0, 1] > 0.75
    # The range of the mean curve is at most the mean of the ranges.
    assert 0.8 * RANGES_DEG[joint][0] < np.ptp(np.degrees(mean)) <= RANGES_DEG[joint][0]


def test_parameters_agree_with_each_other():
    value = {name: mean for name, (mean, _) in PARAMETERS.items()}
    assert value["cadence_steps_per_min"] * value["stride_time_s"] == pytest.approx(120.0, rel=0.02)
    assert value["stride_length_m"] == pytest.approx(2 * value["step_length_m"], rel=0.01)
    assert value["speed_m_s"] == pytest.approx(value["stride_length_m"] / value["stride_time_s"], rel=0.03)
    # Two feet, hence stance minus half a cycle, twice.
    assert value["double_support_ratio"] == pytest.approx(2 * value["stance_ratio"] - 1.0, abs=0.005)
    assert 0.36 < NORMALISED["speed"][0] < 0.49  # free speed
