"""Curves over the gait cycle reproduce known curves."""

from __future__ import annotations

import numpy as np
import pytest

from kinemimic.pipeline.gait.curves import CYCLE, curve_statistics, over_cycle
from kinemimic.pipeline.gait.normative import NORMATIVE_JOINTS, normative_band
from kinemimic.pipeline.gait.parameters import Stride

PERIOD = 1.2


def strides(*starts: float) -> list[Stride]:
    return [
        Stride(0, "left", start, start + 0.7, start + PERIOD, 1.3, 0.6, 0.65, 0.1, 0.2, 0.0)
        for start in starts
    ]


def knee(times):  # type: ignore[no-untyped-def]
    turn = 2 * np.pi * times / PERIOD
    return 0.4 + 0.4 * np.cos(turn - 1.0) + 0.15 * np.sin(2 * turn)


def test_a_curve_of_30_frames_a_second_is_read_between_them_to_a_tenth_of_a_degree() -> None:
    times = np.arange(120) / 30
    rows = over_cycle(times, knee(times), strides(0.31, 0.31 + PERIOD))
    assert rows.shape == (2, 101)
    assert np.degrees(np.abs(rows - knee(0.31 + CYCLE * PERIOD)).max()) < 0.1


def test_strides_with_a_gap_or_beyond_the_recording_have_no_curve() -> None:
    times = np.arange(120) / 30
    curve = knee(times)
    curve[20] = np.nan  # one frame: a spline may pass over it
    curve[60:66] = np.nan  # 0.2 s: it may not
    rows = over_cycle(times, curve, strides(0.2, 1.5, 3.5))
    assert np.isfinite(rows).all(axis=1).tolist() == [True, False, False]
    assert np.isnan(over_cycle(times, np.full(120, np.nan), strides(0.2))).all()


def test_mean_spread_and_range_by_hand() -> None:
    base = np.radians(60.0) * CYCLE
    found = curve_statistics(np.stack([base, base + np.radians(2.0), np.full(101, np.nan)]))
    assert found is not None and found["strides"] == 2
    assert found["mean"][50] == pytest.approx(31.0) and found["sd"][50] == pytest.approx(np.sqrt(2))
    assert found["range_deg"]["mean"] == pytest.approx(60.0)
    assert "norm_rms_deg" not in found
    assert curve_statistics(np.full((2, 101), np.nan)) is None


def test_a_stride_with_exchanged_legs_is_left_out_and_a_varied_walker_is_not() -> None:
    base = 30.0 - 30.0 * np.cos(2 * np.pi * CYCLE)
    alike = np.radians([base + shift for shift in (-2.0, 0.0, 1.0, 3.0)])
    swapped = np.radians(np.roll(base[:-1], 50))
    found = curve_statistics(np.vstack([alike, np.append(swapped, swapped[0])]))
    assert found is not None and found["strides"] == 4
    assert found["mean"][50] == pytest.approx(60.5)
    varied = curve_statistics(np.radians([base + shift for shift in (-12.0, -6.0, 0.0, 8.0, 14.0)]))
    assert varied is not None and varied["strides"] == 5


@pytest.mark.parametrize("joint", NORMATIVE_JOINTS)
def test_the_normal_walker_is_normal_and_one_off_by_five_degrees_is_off_by_five(joint: str) -> None:
    mean, spread = normative_band(joint, CYCLE)
    normal, off = curve_statistics(mean[None], joint), curve_statistics(mean[None] + np.radians(5.0), joint)
    assert normal is not None and off is not None
    assert normal["norm_rms_deg"] == pytest.approx(0.0, abs=1e-9) and normal["norm_within_percent"] == 100
    assert off["norm_rms_deg"] == pytest.approx(5.0)
    assert off["norm_within_percent"] == pytest.approx(100 * np.mean(np.radians(5.0) <= spread))
