"""The line on the sides says what was decided, and by which number."""

from __future__ import annotations

import pytest

from kinemimic.retarget.table import off_the_soles, sides


@pytest.mark.parametrize(
    ("averaged", "differ", "limit", "text"),
    [
        (True, 4.0, 7.0, "averaged, differ by 4.0°, less than the 7.0° that noise explains"),
        (False, 4.7, 3.9, "as recorded, differ by 4.7°, more than the 3.9° that noise explains"),
        (False, 4.8, 0.0, "as recorded, differ by 4.8° (noise 0.6°)"),
    ],
)
def test_sides(averaged: bool, differ: float, limit: float, text: str) -> None:
    report = {"symmetric": averaged, "asymmetry_deg": differ, "noise_deg": 0.6, "asymmetry_limit_deg": limit}
    assert sides(report) == f"  sides      {text}"


def test_balance_is_about_the_middle_of_the_soles_on_the_spot() -> None:
    assert off_the_soles({"cyclic": True}) == "off the soles"
    assert off_the_soles({"cyclic": False}) == "off the middle of the soles"
