"""Summaries and indices against numbers worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest
from samples.motion import walk

from kinemimic.pipeline.gait import parameters as module
from kinemimic.pipeline.gait.footprints import footprints
from kinemimic.pipeline.gait.parameters import (
    Gait,
    Stride,
    measure_gait,
    normalised,
    parameters,
    summary,
    symmetry_index,
)


def stride(side: str, start: float, end: float, length: float) -> Stride:
    """Foot-off after 60 %."""
    off = start + 0.6 * (end - start)
    return Stride(0, side, start, off, end, length, 0.5 * (end - start), 0.5 * length, 0.1, 0.2, 0.0)


def test_summary_by_hand() -> None:
    # Of 1, 2, 4, 5 the mean is 3, the squares sum to 10, and 10 / 3 = 3.333…
    found = summary([1.0, 2.0, 4.0, 5.0])
    assert found == {"mean": 3.0, "sd": pytest.approx(np.sqrt(10 / 3)), "n": 4}
    assert summary([7.0]) == {"mean": 7.0, "sd": None, "n": 1}
    assert summary([]) == {"mean": None, "sd": None, "n": 0}


def test_symmetry_index_by_hand() -> None:
    assert symmetry_index(1.1, 0.9) == pytest.approx(20.0)  # 0.2 of a mean of 1
    assert symmetry_index(0.9, 1.1) == pytest.approx(-20.0)
    assert symmetry_index(0.0, 0.0) is None and symmetry_index(None, 1.0) is None


def test_parameters_by_hand() -> None:
    strides = (stride("left", 0.0, 1.0, 1.2), stride("left", 1.0, 2.2, 1.32), stride("right", 0.5, 1.6, 1.1))
    gait = Gait(strides, 0, {}, np.zeros(0, np.int32), {}, None, False, leg=0.9)
    table = parameters(gait)
    assert table["cadence_steps_per_min"]["left"]["mean"] == pytest.approx((120 + 100) / 2)
    assert table["speed_m_s"]["left"]["mean"] == pytest.approx((1.2 + 1.1) / 2)
    assert table["speed_m_s"]["both"]["mean"] == pytest.approx((1.2 + 1.1 + 1.0) / 3)
    assert table["stance_ratio"]["both"]["mean"] == pytest.approx(0.6)
    assert table["stride_length_m"]["symmetry_percent"] == pytest.approx(100 * (1.26 - 1.1) / 1.18)
    without = normalised(gait)
    assert without["speed"] == pytest.approx(1.1 / np.sqrt(9.81 * 0.9))
    assert without["stride_length"] == pytest.approx((1.2 + 1.32 + 1.1) / 3 / 0.9)


def test_a_stride_whose_steps_are_not_known_is_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a strike after which the foot is never shown flat: two strides of its foot, and one of the other."""
    shown = walk(300)
    found = [measure_gait(shown.times, np.zeros(300, np.int32), shown.joints)]
    known = [footprints(feet) for feet in found[0].feet.values()]
    assert len(known) == 1
    left, right = known[0]
    right[3] = np.nan
    monkeypatch.setattr(module, "footprints", lambda _: (left, right))
    found.append(measure_gait(shown.times, np.zeros(300, np.int32), shown.joints))
    every, used = found
    assert len(used.strides) == len(every.strides) - 3 > 0
    assert used.left_out == every.left_out + 3
    lost = {(one.side, one.start) for one in every.strides} - {(one.side, one.start) for one in used.strides}
    assert sorted(side for side, _ in lost) == ["left", "right", "right"]
    assert np.isfinite([one.step_length for one in used.strides]).all()
