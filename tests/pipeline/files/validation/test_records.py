"""Records and TOML text: what does not fit is one line with the file, the key, and what is expected there."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import pytest
from msgspec import Meta, Struct

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.files.validation.records import RecordError, convert, one_of
from kinemimic.pipeline.files.validation.toml_file import parse_toml


class Joint(Struct, forbid_unknown_fields=True):
    name: str
    axis: Annotated[str, one_of(("X", "Y"))] | None = None


@dataclass
class Range:
    low: float
    high: Annotated[float, Meta(ge=0.0, le=9.0)] = 1.0

    def __post_init__(self) -> None:
        if self.low > self.high:
            raise RecordError("low", expected="at most high", found=f"{self.low:g}")


@dataclass
class Document:
    schema: Literal[1]
    unit: Literal["m", "cm"] | Annotated[float, Meta(ge=0.5)] = "m"
    joints: tuple[Joint, ...] = ()
    ranges: dict[str, Range] | None = None
    nested: tuple[dict[str, int], ...] = ()
    place: tuple[float, float, float] = (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({}, "key schema: expected 1, found none"),
        ({"schema": True}, "key schema: expected 1, found True"),
        (
            {"schema": 1, "unit": "mm"},
            r"key unit: expected one of cm, m or a number from 0\.5, found 'mm'; did",
        ),
        ({"schema": 1, "unit": 0.1}, r"key unit: expected one of cm, m or a number from 0\.5, found 0\.1"),
        ({"schema": 1, "joints": 3}, "key joints: expected a list, found 3"),
        (
            {"schema": 1, "joints": [{"name": "a"}, {}]},
            r"key joints\[2\]\.name: expected text .*, found none",
        ),
        (
            {"schema": 1, "joints": [{"nam": 1}]},
            r"key joints\[1\]\.nam: expected one of name, axis, .*'name'\?",
        ),
        (
            {"schema": 1, "joints": [{"name": "", "axis": "Z"}]},
            r"key joints\[1\]\.axis: expected one of X, Y, .* 'Z'",
        ),
        (
            {"schema": 1, "ranges": {"a": {"low": 0}, "b": {"low": "x"}}},
            r"key ranges\.b\.low: .* number, found 'x'",
        ),
        ({"schema": 1, "ranges": {"a": {"low": 2}}}, r"key ranges\.a\.low: expected at most high, found 2"),
        (
            {"schema": 1, "ranges": {"a": {"low": 0, "hgh": 2}}},
            r"key ranges\.a\.hgh: .*did you mean 'high'\?",
        ),
        (
            {"schema": 1, "nested": [{}, {"a": 1, "b": 1.5}]},
            r"key nested\[2\]\.b: expected a whole number, found 1",
        ),
        ({"schema": 1, "place": [1, 2]}, r"key place: expected 3 numbers, found \[1, 2\]"),
        ({"schema": 1, "place": [1, 2, "x"]}, r"key place\[3\]: expected a number, found 'x'"),
        ({"schema": 1, "place": [0, 0, 10**400]}, r"key place\[3\]: expected whole numbers from -2\^63 to"),
        (3, ": expected a table, found 3"),
    ],
)
def test_an_error_names_the_key_and_what_is_expected(values: Any, message: str) -> None:
    with pytest.raises(CaptureError, match=rf"^x\.toml(, )?{message}"):
        convert(values, Document, "x.toml")


def test_a_part_of_a_file_has_its_key_and_advice() -> None:
    with pytest.raises(
        CaptureError, match=r"^x\.json, key a\.low: expected a number, found 'y'; train again$"
    ):
        convert({"low": "y"}, Range, "x.json", within=("a",), advice="train again")
    assert convert({"low": 0}, Range, "x.json") == Range(0.0, 1.0)


def test_values_come_as_they_are() -> None:
    least, most = -(2**63), 2**63 - 1
    text = f"a = [{least}, {{ b = {most} }}]\nc = true\n[d]\ne = 1e400\n"
    values = {"a": [least, {"b": most}], "c": True, "d": {"e": float("inf")}}
    assert convert(parse_toml(Path("x"), text), dict[str, Any], "x") == values


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a = ", "x.toml: expected TOML, found the end of the text in line 1"),
        ("a = 1\nb b", "x.toml: expected TOML, found 'b' in line 2, column 3"),
        ("[a]\n[a]\n", "x.toml: expected TOML, found a key or a table for the second time in line 2"),
        ("a = " + 5000 * "[", "x.toml: expected TOML, found deep nesting"),
        (500 * "a." + "a = 1", "x.toml: expected a record, found deep nesting"),
        ("a = " + 5000 * "9", "x.toml: expected TOML, found a number with thousands of digits"),
        (
            f"[a]\nb = [1, {2**63}]",
            r"x.toml, key a\.b\[2\]: expected whole numbers from .*, found .* 20 digits",
        ),
        (f"a = 0x{5000 * 'f'}", "x.toml, key a: .*found one of some 6,021 digits"),
        (f"{500 * 'a'} = {10**400}", "x.toml, key a+ …: "),
    ],
)
def test_text_that_is_not_toml_or_too_large_is_one_short_line(text: str, message: str) -> None:
    with pytest.raises(CaptureError, match=message) as caught:
        convert(parse_toml(Path("x.toml"), text), dict[str, Any], "x.toml")
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 300
