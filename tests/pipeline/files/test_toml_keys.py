"""TOML text: what is none, or none that can be worked with, is one line."""

from __future__ import annotations

from pathlib import Path

import pytest

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.files.toml_keys import parse_toml


def test_values_come_as_they_stand() -> None:
    least, most = -(2**63), 2**63 - 1
    text = f"a = [{least}, {{ b = {most} }}]\nc = true\n[d]\ne = 1e400\n"
    assert parse_toml(Path("x"), text) == {"a": [least, {"b": most}], "c": True, "d": {"e": float("inf")}}


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("a = ", "x.toml: expected TOML, found .*end of document"),
        ("a = " + 5000 * "[", "x.toml: expected TOML, found deep nesting"),
        (500 * "a." + "a = 1", "x.toml: expected TOML, found deep nesting"),
        ("a = " + 5000 * "9", "x.toml: expected TOML, found a number of thousands of digits"),
        (
            f"[a]\nb = [1, {2**63}]",
            r"x.toml, key a\.b: expected whole numbers from .*, found .* 20 digits",
        ),
        (f"a = 0x{5000 * 'f'}", "x.toml, key a: .*found one of some 6,021 digits"),
        (f"{500 * 'a'} = {10**400}", "x.toml, key a+ …: "),
    ],
)
def test_what_is_no_toml_is_one_short_line(text: str, told: str) -> None:
    with pytest.raises(CaptureError, match=told) as caught:
        parse_toml(Path("x.toml"), text)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 300
