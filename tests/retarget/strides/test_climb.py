"""The climb of a walk that its loop leaves out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from samples.asymmetry import on_a_ramp
from samples.bouts import bouts_of
from samples.walker import joined, walker

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.retarget.motion_warnings import climb_warnings
from kinemimic.retarget.strides.climb import Climb, climb_of


def found(clip: Clip) -> Climb:
    return climb_of(clip, bouts_of(clip))


@pytest.mark.parametrize("degrees", [8.0, 3.0, -8.0])
def test_a_ramp_is_measured_by_stride_and_angle(degrees: float) -> None:
    w = walker(seconds=7.7)
    climb = found(on_a_ramp(w.clip, degrees))
    assert climb.certain
    assert np.degrees(climb.angle) == pytest.approx(degrees, abs=0.2)
    assert climb.stride == pytest.approx(np.tan(np.radians(degrees)) * w.speed * w.period, abs=0.01)
    assert climb.total == pytest.approx(7.0 * climb.stride, rel=0.05)


def test_a_level_walk_and_a_floor_that_falls_by_one_in_eighty_stay_quiet() -> None:
    clip = walker(seconds=7.7).clip
    assert not found(clip).certain
    assert not found(on_a_ramp(clip, 0.7)).certain


def test_the_tilt_of_a_depth_sensor_is_no_climb() -> None:
    clip = walker(seconds=7.7, rate=30.0, noise=0.012).clip
    climb = found(on_a_ramp(clip, 9.0))
    assert not climb.precise and not climb.certain
    assert np.degrees(climb.angle) == pytest.approx(9.0, abs=1.0)


def test_bouts_up_and_down_do_not_cancel() -> None:
    up = on_a_ramp(walker(seconds=7.7).clip, 6.0)
    down = on_a_ramp(walker(seconds=4.4).clip, -6.0)
    both = joined(up, down)
    numbers = np.repeat(np.arange(2, dtype=np.int32), [len(up.times), len(down.times)])
    assert np.degrees(found(replace(both, passes=numbers)).angle) == pytest.approx(6.0, abs=0.5)


def test_the_sentence_names_stride_and_angle() -> None:
    climb = {"stride_m": 0.11, "angle_deg": 4.6, "total_m": 0.8, "certain": True}
    report = {"kind": "walk", "climb": climb}
    assert climb_warnings(report) == ["levelled: the walk climbs 0.11 m per stride (4.6°)"]
    assert climb_warnings({"kind": "run", "climb": climb | {"stride_m": -0.11}})[0].startswith(
        "levelled: the run descends"
    )
    assert climb_warnings({"kind": "walk", "climb": climb | {"certain": False}}) == []
