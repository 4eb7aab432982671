"""Any JSON gives its values or one clear error."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from samples import source_of

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.readers.base import json_text
from kinemimic.pipeline.readers.base.json_text import numbers, parse_json


def parse(text: str) -> object:
    return parse_json(source_of(text, Path("a.json")))


def test_values_come_out() -> None:
    assert parse('\ufeff{"a": [1, 2.5, null]}') == {"a": [1, 2.5, None]}
    assert np.isnan(parse("[NaN]")[0])  # type: ignore[index]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('{"a": 1,\n "b" 2}', r"line 2, column 6: expected JSON, found expecting ':' delimiter"),
        ('{"a": [1, 2', r"line 1, column 12: expected JSON.*cut off there"),
        ("[" * 100_000, "brackets nested hundreds deep"),
        ('{"a":' * 100_000, "brackets nested hundreds deep"),
        ('{"a": 1, "a": 2}', "every key of an object once, found 'a' twice"),
        ("[" + "9" * 5000 + "]", "thousands of digits"),
        ("[1] 2", "extra data"),
    ],
)
def test_damage_gives_one_line(text: str, says: str) -> None:
    with pytest.raises(CaptureError, match=says) as caught:
        parse(text)
    assert "\n" not in str(caught.value)


def test_more_values_than_memory_allows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(json_text, "MAX_VALUES", 10)
    assert parse("[" + "1," * 10 + "1]") == [1] * 11
    with pytest.raises(CaptureError, match="at most 10 values, found 11"):
        parse("[" + "1," * 11 + "1]")


def test_numbers_are_numbers_only() -> None:
    assert numbers([[1, 2.5], [3, -4]]).tolist() == [[1.0, 2.5], [3.0, -4.0]]  # type: ignore[union-attr]
    holes = numbers([1.0, None])
    assert holes is not None
    assert holes[0] == 1.0
    assert np.isnan(holes[1])
    assert numbers([2**80]).tolist() == [2.0**80]  # type: ignore[union-attr]
    for none in (["1.0"], [1.0, "2"], [True, False], [None, True], [[1], [1, 2]], [{}], [10**400], [[[]], 1]):
        assert numbers(none) is None
