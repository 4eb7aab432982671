"""The direction in which a reference moves."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from peers.elsewhere import backwards, on_the_spot, turned

from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.reference.heading import heading
from kinemimic.train.reference.reference import Reference


def test_heading_is_that_of_the_root_or_of_the_pelvis_at_rest(motion: Motion) -> None:
    assert heading(Reference(motion), 0.3) == pytest.approx(0.0, abs=1e-9)
    assert heading(Reference(turned(motion, 2.0)), 0.3) == pytest.approx(2.0)
    assert heading(Reference(on_the_spot(turned(motion, 2.0))), 0.3) == pytest.approx(2.0)
    assert abs(heading(Reference(backwards(motion)), 0.3)) == pytest.approx(math.pi)
    # A performance that is not repeated: the way of half a second before and after.
    once = replace(turned(motion, -1.0), cyclic=False)
    assert heading(Reference(once), 0.9) == pytest.approx(-1.0)
