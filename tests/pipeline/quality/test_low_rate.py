"""Low frame rates are noted."""

from __future__ import annotations

import pytest

from kinemimic.pipeline.quality.low_rate import low_rate_note


@pytest.mark.parametrize("rate", [1.0 / 0.050001, 20.0, 30.0, 120.0, float("nan")])
def test_usual_rates_have_no_note(rate: float) -> None:
    assert low_rate_note(rate) == ""


@pytest.mark.parametrize("rate", [10.0, 15.0, 19.9])
def test_a_low_rate_is_stated_with_its_effect(rate: float) -> None:
    note = low_rate_note(rate)
    assert f"{rate:.1f} Hz" in note and "flattened" in note
