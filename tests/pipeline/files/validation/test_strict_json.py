"""Strict JSON is what Python's parser makes of it, without what is no JSON."""

from __future__ import annotations

import json
import math
import random

import pytest

from kinemimic.pipeline.files.validation.strict_json import strict_json


def test_values_are_those_of_pythons_parser() -> None:
    draw = random.Random(0)
    numbers = [draw.uniform(-1, 1) * 10.0 ** draw.randint(-320, 300) for _ in range(2000)]
    document = {"numbers": numbers, "text": "\u00e9\n\U0001f600", "whole": [10**30, -0.0, 0, True, None]}
    found = strict_json(json.dumps(document))
    assert found == document
    assert math.copysign(1.0, found["whole"][1]) == -1.0
    assert [type(value) for value in found["whole"]] == [int, float, int, bool, type(None)]
    # Half of a character: `read_json` refuses it, with a reason.
    assert strict_json('"\\ud800"') == "\ud800"


@pytest.mark.parametrize("text", ["NaN", "[-Infinity]", "1e999", '{"a": -1e400}'])
def test_numbers_that_are_not_finite_are_refused_unless_asked_for(text: str) -> None:
    with pytest.raises(ValueError, match="which is not a JSON number"):
        strict_json(text)
    assert strict_json(text, finite=False) is not None


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("[1,\n2,\n]", r"^'\]' in line 3, column 1$"),
        ("", "^the end of the text in line 1$"),
        ('{"a": 1\n "b": 2}', "^'\"b\": 2}' in line 2, column 2$"),
        ("[" * 100_000 + "]" * 100_000, "nested too deep"),
        ("9" * 10_000, "thousands of digits"),
    ],
)
def test_what_is_no_json_is_refused_with_the_place(text: str, reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        strict_json(text)
