"""Which bouts become one loop: those that walk like the one with the most usable strides."""

from __future__ import annotations

from dataclasses import replace

import pytest
from samples.bouts import bouts_of
from samples.walker import walker

from kinemimic.pipeline.locomotion.bouts import Bout
from kinemimic.retarget.strides.selection import select_bouts, why_strides_are_left_out


@pytest.fixture(scope="module")
def bout() -> Bout:
    (one,) = bouts_of(walker(seconds=6.0).clip)
    return one


def numbered(bout: Bout, *changes: dict[str, object]) -> list[Bout]:
    return [replace(bout, number=k, **change) for k, change in enumerate(changes)]  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "speeds", [(0.02, -0.03, 0.05), (0.0, 0.0, 0.0), (-0.05, -0.1, -0.02), (0.1, -0.04, 0.0, 0.08)]
)
def test_bouts_on_the_spot_are_all_used(bout: Bout, speeds: tuple[float, ...]) -> None:
    """Around zero a share of the speed means nothing."""
    chosen = select_bouts(numbered(bout, *({"speed": speed} for speed in speeds)))
    assert len(chosen.bouts) == len(speeds) and chosen.reasons == {}


def test_bouts_of_another_speed_or_period_are_left_out_with_a_reason(bout: Bout) -> None:
    found = numbered(bout, {}, {"speed": 1.2 * bout.speed}, {"speed": 0.6 * bout.speed}, {"period": 1.5})
    chosen = select_bouts(found)
    assert [one.number for one in chosen.bouts] == [0, 1]
    assert "m/s" in chosen.reasons[2] and "1.50 s" in chosen.reasons[3]
    assert chosen.strides == pytest.approx(2 * bout.used_strides)


def test_walks_and_runs_are_not_mixed(bout: Bout) -> None:
    long = replace(bout, running=True, strides=bout.strides + bout.strides)
    chosen = select_bouts(numbered(long, {}, {"running": False, "strides": bout.strides}))
    assert [one.number for one in chosen.bouts] == [0]
    assert chosen.reasons == {1: "walks, the others run"}


def test_walking_backward_becomes_no_loop(bout: Bout) -> None:
    chosen = select_bouts(numbered(bout, {"backward": True, "speed": -1.0}))
    assert chosen.bouts == () and "backward" in chosen.reasons[0]
    both = select_bouts(numbered(bout, {"backward": True, "speed": -1.0}, {}))
    assert [one.number for one in both.bouts] == [1]


def test_a_bout_without_usable_strides_says_why(bout: Bout) -> None:
    strides = tuple(replace(one, used=(False, False), reason="turns by 90°") for one in bout.strides)
    chosen = select_bouts(numbered(bout, {"strides": strides}))
    assert chosen.bouts == () and chosen.strides == 0
    assert f"{len(strides)} x turns by 90°" in chosen.reasons[0]
    assert why_strides_are_left_out([bout]) == ""


def test_no_bouts_select_nothing() -> None:
    assert select_bouts([]).bouts == ()
