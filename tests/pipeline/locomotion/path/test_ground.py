"""The ground from the ankles of feet in stance."""

from __future__ import annotations

import numpy as np
import pytest

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import NODES
from kinemimic.pipeline.locomotion.path.ground import ground_height

CYCLES, FRAMES = 12.0, 720
PHASE = CYCLES * np.arange(FRAMES) / FRAMES


def ankles_over(ground: Array) -> Array:
    """Positions (T, 20, 3) of ankles 8 cm above a ground (T,) while the foot is flat, from 0.05 to 0.4 cycles
    after it was farthest ahead, and up to 0.3 m above that in between."""
    positions = np.full((FRAMES, len(NODES), 3), np.nan)
    for side, later in (("left", 0.0), ("right", 0.5)):
        own = np.mod(PHASE + later, 1.0)
        swing = np.where((own > 0.05) & (own < 0.4), 0.0, 0.3)
        positions[:, N[f"ankle_{side}"]] = np.stack([0.0 * own, 0.0 * own, ground + 0.08 + swing], axis=1)
    return positions


@pytest.mark.parametrize("follow", [False, True])
@pytest.mark.parametrize("height", [-0.4, 0.0, 1.3])
def test_level_ground_is_found_at_its_height(height: float, follow: bool) -> None:
    found = ground_height(ankles_over(np.full(FRAMES, height)), PHASE, follow=follow)
    np.testing.assert_allclose(found, height, atol=1e-12)


def test_a_slope_is_followed() -> None:
    """Away from the ends, beyond which no stance is known: there it is level."""
    slope = 0.05 * PHASE
    found = ground_height(ankles_over(slope), PHASE, follow=True)
    inner = (PHASE > 4.5) & (PHASE < CYCLES - 4.5)
    np.testing.assert_allclose(found[inner], slope[inner], atol=1e-3)
    assert (np.diff(found) >= -1e-12).all()


def test_without_following_a_slope_has_one_height() -> None:
    slope = 0.05 * PHASE
    found = ground_height(ankles_over(slope), PHASE, follow=False)
    assert np.ptp(found) == 0.0
    assert found[0] == pytest.approx(slope.mean(), abs=0.02)


@pytest.mark.parametrize("follow", [False, True])
def test_one_step_onto_a_box_does_not_lift_the_ground(follow: bool) -> None:
    box = np.where((PHASE > 5.0) & (PHASE < 5.45), 0.3, 0.0)
    positions = ankles_over(np.zeros(FRAMES))
    positions[:, N["ankle_left"], 2] += box
    np.testing.assert_allclose(ground_height(positions, PHASE, follow=follow), 0.0, atol=1e-12)
