"""Footprints of a walk whose feet stand still at known places."""

from __future__ import annotations

import numpy as np
import pytest
from samples.motion import walk

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.gait.events import FootEvents
from kinemimic.pipeline.gait.footprints import footprints
from kinemimic.pipeline.gait.parameters import measure_gait, parameters

PERIOD, STANCE, STRIDE = 1.2, 0.7, 1.3


def known(seconds: float, error: float = 0.0) -> FootEvents:
    """Feet that stand at multiples of STRIDE, the right one half a stride later and 0.1 m to the right.

    A foot lands until 0.1 s after its strike, in which it still moves by 4 cm, and 1 cm inward. error: of the
    strikes, seconds.
    """
    times = np.arange(0.0, seconds, 0.01)
    ankles = np.zeros((len(times), 2, 3))
    strikes, offs = [], []
    for foot, side in enumerate((1.0, -1.0)):
        t = times - 0.5 * PERIOD * foot
        k = np.floor(t / PERIOD)
        since = t - k * PERIOD
        landing = np.clip(1.0 - since / 0.1, 0.0, 1.0)
        swing = np.clip((since - STANCE) / (PERIOD - STANCE), 0.0, 1.0)
        ankles[:, foot, 0] = STRIDE * (k + 0.5 * foot) - 0.04 * landing + (STRIDE - 0.04) * swing
        ankles[:, foot, 1] = 0.05 * side * (1.0 + 0.2 * np.maximum(landing, swing))
        at = np.arange(0.5 * foot * PERIOD, seconds, PERIOD)
        strikes.append(at + error * (-1.0) ** np.arange(len(at)))
        offs.append(at[at + STANCE < seconds] + STANCE)
    seen = np.ones((len(times), 2), dtype=np.bool_)
    return FootEvents(times, ankles.mean(axis=1), ankles, seen, (strikes[0], strikes[1]), (offs[0], offs[1]))


def expected(feet: FootEvents, foot: int) -> Array:
    count = len(feet.strikes[foot])
    return np.stack([STRIDE * (np.arange(count) + 0.5 * foot), np.full(count, 0.05 - 0.1 * foot)], axis=1)


@pytest.mark.parametrize("error", [0.0, 0.03])
def test_a_footprint_is_where_the_foot_stands_whenever_it_struck(error: float) -> None:
    feet = known(6.0, error)
    for foot, prints in enumerate(footprints(feet)):
        np.testing.assert_allclose(prints, expected(feet, foot), atol=1e-9)


@pytest.mark.parametrize("seconds", [4.85, 4.95, 5.0, 5.2])
def test_the_last_print_is_known_even_if_the_pass_ends_as_the_foot_lands(seconds: float) -> None:
    feet = known(seconds)
    for foot, prints in enumerate(footprints(feet)):
        np.testing.assert_allclose(prints, expected(feet, foot), atol=1e-9)


def test_no_print_of_a_foot_that_the_pass_never_shows_flat() -> None:
    left, right = footprints(known(0.75))
    assert np.isfinite(left).all()
    assert np.isnan(right).all() and len(right) == 1


def test_noise_of_a_kinect_leaves_the_lengths_of_single_steps_within_a_centimetre() -> None:
    """With the ankles at the strikes instead, both standard deviations are 2.2 cm."""
    shown = walk(300)
    deviations = []
    for seed in range(4):
        noise = 0.015 * np.random.default_rng(seed).standard_normal(shown.joints.shape)
        gait = measure_gait(shown.times, np.zeros(len(shown.times), np.int32), shown.joints + noise)
        table = parameters(gait)
        deviations.append([table[name]["both"]["sd"] for name in ("stride_length_m", "step_length_m")])
    assert np.max(np.mean(deviations, axis=0)) < 0.01
