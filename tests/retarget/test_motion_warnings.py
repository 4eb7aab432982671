"""A loop that its strides do not follow is warned of."""

from __future__ import annotations

import pytest

from kinemimic.retarget.motion_warnings import knee_warnings, side_warnings, width_warnings


@pytest.mark.parametrize(
    ("precise", "left", "warned"),
    [(True, 0.97, False), (True, 0.83, False), (True, 0.70, True), (False, 0.45, False), (False, 0.19, True)],
)
def test_the_limit_depends_on_the_sensor(precise: bool, left: float, warned: bool) -> None:
    """0.70 was standing in the loop of an optical capture; 0.83 and 0.33 are the least of real walks."""
    report = {
        "reliability": {"precise": precise},
        "r2_loop_against_capture": {
            "knee_left": left,
            "knee_right": 0.99,
            "hip_left": 0.1,
            "hip_right": None,
        },
    }
    found = knee_warnings(report)
    assert bool(found) == warned
    if warned:
        assert f"left {left:.2f}" in found[0] and "right" not in found[0]


def test_a_knee_without_a_score_is_not_warned_of() -> None:
    report = {"reliability": {"precise": True}, "r2_loop_against_capture": {"knee_left": None}}
    assert knee_warnings(report) == []


@pytest.mark.parametrize(
    ("symmetric", "left", "right", "warned"),
    [(True, 7, 0, "right"), (True, 0, 3, "left"), (True, 7, 1, ""), (False, 7, 0, ""), (True, 0, 0, "")],
)
def test_a_side_that_is_only_a_mirror_image(symmetric: bool, left: int, right: int, warned: str) -> None:
    bouts = [
        {"used": True, "left_legs_used": left, "right_legs_used": right},
        {"used": False, "left_legs_used": 5, "right_legs_used": 5},
    ]
    found = side_warnings({"symmetric": symmetric, "bouts": bouts})
    assert bool(found) == bool(warned)
    if warned:
        assert f"no stride of the {warned} leg could be used" in found[0]


@pytest.mark.parametrize(
    ("was", "now", "why"),
    [(0.03, 0.08, "soles"), (0.25, 0.16, "optical"), (0.078, 0.08, ""), (0.25, 0.25, "")],
)
def test_a_stance_that_is_not_the_captures(was: float, now: float, why: str) -> None:
    found = width_warnings({"stance_width_m": was, "stance_width_body_m": now})
    assert bool(found) == bool(why)
    if why:
        assert why in found[0] and f"{100 * now:.0f} cm apart, the capture's {100 * was:.0f} " in found[0]


def test_a_motion_without_strides_has_no_stance() -> None:
    assert width_warnings({}) == []
