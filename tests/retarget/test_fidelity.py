"""Where the loop on the body departs from the loop that the capture showed."""

from __future__ import annotations

import numpy as np
import pytest
from samples.bouts import bouts_of
from samples.walker import walker

from kinemimic.retarget.cyclic import fit_cyclic
from kinemimic.retarget.fidelity import departure_warnings, departures

RANGES = {
    "knee_left": [2.0, 66.0],
    "knee_right": [1.0, 64.0],
    "hip_left": [-29.0, 35.0],
    "hip_right": [-28.0, 34.0],
}


def report(**changed):
    alike = {"left": 0.70, "right": 0.66}
    return {
        "symmetric": False,
        "range_deg": RANGES,
        "range_captured_deg": RANGES,
        "step_m": alike,
        "step_captured_m": alike,
        **changed,
    }


def test_the_loop_of_a_clean_walker_departs_nowhere():
    w = walker(seconds=4.4)
    fit = fit_cyclic(w.clip, bouts_of(w.clip))
    found = departures(fit)
    for name, (low, high) in found["range_captured_deg"].items():
        truth = np.degrees(w.curves(np.arange(100) / 100)[name])
        assert (low, high) == pytest.approx((truth.min(), truth.max()), abs=1.5)
    half = 0.5 * fit.scale * w.speed * w.period
    assert found["step_captured_m"] == pytest.approx({"left": half, "right": half}, abs=0.01)
    assert sum(found["step_m"].values()) == pytest.approx(float(fit.motion.cycle_offset[0]), abs=1e-3)


def test_a_range_that_a_limit_cuts_is_told_with_both_numbers():
    assert departure_warnings(report()) == []
    cut = {**RANGES, "hip_left": [-29.0, 26.0]}
    (one,) = departure_warnings(report(range_deg=cut))
    assert (
        one
        == "the left hip moves through 55° (-29 to 26°) in the motion, but 64° in the capture (-29 to 35°)"
    )
    both = {**cut, "hip_right": [-29.0, 26.0]}
    (one,) = departure_warnings(report(range_deg=both, symmetric=True))
    assert one.startswith("each hip moves through 55°")


def test_a_knee_beyond_straight_is_no_range():
    assert departure_warnings(report(range_captured_deg={**RANGES, "knee_left": [-9.0, 66.0]})) == []


def test_steps_whose_difference_turns_round_are_told_unless_the_sides_were_averaged():
    other = {"left": 0.64, "right": 0.72}
    (one,) = departure_warnings(report(step_m=other))
    assert one.startswith("left and right steps of 64 and 72 cm, but 70 and 66 cm in the capture")
    assert departure_warnings(report(step_m=other, symmetric=True)) == []
