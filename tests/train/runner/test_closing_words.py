"""The last lines of a training."""

from __future__ import annotations

import pytest

from kinemimic.train.runner.closing_words import mirroring


@pytest.mark.parametrize(
    ("mirrored", "tracking", "text"),
    [
        (False, None, ""),
        (True, None, ", the second half of the cycle mirrors the first"),
        # A tracker performs motions without cycles too.
        (True, {"leash": 0.3}, ", left and right mirrored"),
    ],
)
def test_only_a_gait_has_a_second_half(mirrored: bool, tracking: dict[str, float] | None, text: str) -> None:
    assert mirroring({"mirrored": mirrored, "config": {"env": {"tracking": tracking}}}) == text
