from __future__ import annotations

import math

import msgspec
import pytest

from kinemimic.evaluate.simulate.session.inputs import (
    Carry,
    Drag,
    Ground,
    Push,
    Throw,
    checked,
    decoded,
    finite,
)
from kinemimic.pipeline.errors import KinemimicError


@pytest.mark.parametrize(
    "found",
    [
        Drag("hand_left", (0.0, 0.1, 0.0), (1.0, 2.0, 3.0)),
        Push("torso", force=(25.0, 0.0, 0.0), steps=30, growing=True),
        Throw("sphere", (0.24, 0.24, 0.24), 1.0, (1.8, 0.0, 1.1), (-2.0, 0.0, 2.6)),
        Ground(0.3, 0.05),
    ],
)
def test_an_input_survives_json(found: object) -> None:
    assert decoded(msgspec.json.encode(found)) == found
    assert checked(found) == found  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{}",
        "null",
        '{"type": "explode"}',
        '{"type": "push"}',
        '{"type": "push", "body": "tail"}',
        '{"type": "push", "body": "torso", "force": [1, 2]}',
        '{"type": "push", "body": "torso", "force": [1e9, 0, 0]}',
        '{"type": "push", "body": "torso", "force": [NaN, 0, 0]}',
        '{"type": "push", "body": "torso", "steps": 0}',
        '{"type": "throw", "shape": "cone", "size": [1, 1, 1], "mass": 1, "position": [0, 0, 0]}',
        '{"type": "throw", "shape": "box", "size": [0, 1, 1], "mass": 1, "position": [0, 0, 0]}',
        '{"type": "ground", "slope": 2.0}',
        '{"type": "restart", "phase": 1.5}',
        '{"type": "enter", "scenario": "' + 200 * "x" + '"}',
        "[" * 5000,
        b"\xff\xfe",
    ],
)
def test_other_inputs_are_refused(text: str | bytes) -> None:
    with pytest.raises(KinemimicError, match="expected"):
        decoded(text)


@pytest.mark.parametrize("number", [math.nan, math.inf])
def test_numbers_that_are_not_finite_do_not_pass(number: float) -> None:
    assert not finite(1.0, number)
    with pytest.raises(KinemimicError):
        checked(Carry("hand_left", number))
