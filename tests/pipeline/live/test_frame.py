"""Frames as senders give them: what is taken, and what is refused in one line."""

from __future__ import annotations

import json

import numpy as np
import pytest

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.live.frame import MAX_LINE, decoded_frame, frame_of
from kinemimic.pipeline.live.layouts import LAYOUTS


def line(joints: int = 20, **changed: object) -> bytes:
    return json.dumps({"time": 1.5, "positions": [[0.1, 0.2, 0.3]] * joints, **changed}).encode()


@pytest.mark.parametrize("joints", sorted(LAYOUTS))
def test_every_layout_is_taken(joints: int) -> None:
    frame = decoded_frame(line(joints))
    points, states = frame.arrays()
    assert points.shape == (joints, 3)
    assert frame.time == 1.5
    assert (states == 2).all()


def test_each_layout_shows_both_legs_and_the_trunk() -> None:
    for layout in LAYOUTS.values():
        legs = {f"{joint}_{side}" for joint in ("hip", "knee", "ankle", "foot") for side in ("left", "right")}
        assert legs | {"head", "shoulder_left", "wrist_right"} <= layout.nodes.keys()
        used = [joint for joints in layout.nodes.values() for joint in joints]
        assert len(set(used)) == len(used)
        for node, joints in layout.nodes.items():
            if node.endswith(("_left", "_right")):
                assert all(node.rsplit("_", 1)[1] in layout.joints[joint].lower() for joint in joints)


def test_missing_joints_are_nan_and_confidence_becomes_states() -> None:
    positions = [[1.0, 2.0, 3.0]] * 18 + [None, [0.0, 0.0, 0.0]]
    points, states = decoded_frame(line(positions=positions)).arrays()
    assert np.isnan(points[18:]).all()
    assert states.tolist() == [2] * 18 + [0, 0]
    _, states = decoded_frame(line(confidence=[0.9] * 10 + [0.3] * 5 + [0.1] * 5)).arrays()
    assert states.tolist() == [2] * 10 + [1] * 5 + [0] * 5


@pytest.mark.parametrize("written", [b"NaN", b"null", b"Infinity", b"-Infinity"])
def test_a_joint_with_a_number_missing_was_not_seen(written: bytes) -> None:
    points, states = decoded_frame(line().replace(b"0.1", written, 1)).arrays()
    assert np.isnan(points[0]).all()
    assert states.tolist() == [0] + [2] * 19
    assert np.isfinite(points[1:]).all()


@pytest.mark.parametrize("unit", [1.0, 1e3, 1e6, 1e9])
def test_times_since_1970_may_be_in_other_units(unit: float) -> None:
    assert decoded_frame(line(time=1_795_913_150.25 * unit)).time == pytest.approx(1_795_913_150.25, abs=1e-3)


def test_a_byte_order_mark_and_a_confidence_with_rounding() -> None:
    _, states = decoded_frame(b"\xef\xbb\xbf" + line(confidence=[1.0000001] * 20)).arrays()
    assert (states == 2).all()


def test_a_frame_survives_its_text() -> None:
    rng = np.random.default_rng(0)
    points = rng.normal(size=(20, 3))
    points[3] = np.nan
    frame = frame_of(0.1 + 0.2, points)
    text = json.dumps({"time": frame.time, "positions": frame.positions})
    again = decoded_frame(text.encode())
    assert again.time == frame.time
    assert np.array_equal(again.arrays()[0], points, equal_nan=True)


@pytest.mark.parametrize(
    "text",
    [
        b"",
        b"{",
        b"null",
        b"[1, 2]",
        b"\xff\xfe",
        b"[" * 9000,
        line(19),
        line(0),
        line(34),
        line(time="now"),
        line(time=1e300),
        line(positions=[[1.0, 2.0]] * 20),
        line(positions=[[1e9, 0.0, 0.0]] * 20),
        line().replace(b"0.1", b"1e999", 1),
        line(states=[2] * 19),
        line(states=[3] * 20),
        line(confidence=[2.0] * 20),
        b" " * MAX_LINE + line(),
    ],
)
def test_anything_else_is_one_line(text: bytes) -> None:
    with pytest.raises(KinemimicError) as error:
        decoded_frame(text)
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 300
