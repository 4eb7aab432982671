"""TOML, and the keys of its tables, asked for by name and type; a mistake is one line that names the key."""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

from kinemimic.pipeline.errors import CaptureError

Column = str | int

# More columns than any recorder writes: a Kinect v2 with everything has some 300.
MAX_COLUMNS = 10_000
# Larger numbers than this are no lengths in any unit.
_SANE = 1e6
_DEEPEST = 32


def short(text: str, most: int = 80) -> str:
    """A text on one line, cut to what a message can hold."""
    line = " ".join(text.split())
    return line if len(line) <= most else f"{line[: most - 2]} …"


def parse_toml(path: Path, text: str) -> dict[str, Any]:
    """The values of a TOML file's text; path: what messages call it.

    CaptureError for what is no TOML, is nested too deep, or has a whole number of more than the 64 bits that
    TOML promises: Python takes any, and cannot print or divide them all.
    """
    try:
        values = tomllib.loads(text)
    except RecursionError:
        raise CaptureError(path, expected="TOML", found="deep nesting") from None
    except tomllib.TOMLDecodeError as error:
        raise CaptureError(path, expected="TOML", found=short(str(error), 200)) from None
    except ValueError:
        # int() refuses thousands of digits, which tomllib passes on.
        raise CaptureError(path, expected="TOML", found="a number of thousands of digits") from None
    stack: list[tuple[tuple[str, ...], Any]] = [((), values)]
    while stack:
        place, value = stack.pop()
        if len(place) > _DEEPEST:
            # Dotted keys nest without limit, and printing them is what fails then.
            raise CaptureError(path, expected="TOML", found="deep nesting")
        if isinstance(value, dict):
            stack += [((*place, name), item) for name, item in value.items()]
        elif isinstance(value, list):
            stack += [((*place, ""), item) for item in value]
        elif isinstance(value, int) and not -(2**63) <= value < 2**63:
            raise CaptureError(
                path,
                where=f"key {short('.'.join(filter(None, place)))}",
                expected="whole numbers from -2^63 to 2^63 - 1",
                found=f"one of some {1 + int(0.30103 * value.bit_length()):,} digits",
            )
    return values


class Keys:
    """One table of a TOML file: `name` is its key ("" for the file itself), `values` what stands in it.

    Every method takes a key that may stand there; `finish` refuses those that nobody asked for.
    """

    def __init__(self, path: Path, name: str, values: Mapping[str, Any]) -> None:
        self.path = path
        self.name = name
        self.values = values
        self._asked: dict[str, None] = {}  # in sequence, each once

    def full(self, key: str) -> str:
        """The key as one finds it in the file: "space.up"."""
        return f"{self.name}.{key}" if self.name else key

    def fail(self, key: str, *, expected: str, found: Any, advice: str | None = None) -> NoReturn:
        """A CaptureError about a key."""
        text = found if isinstance(found, str) else "none" if found is None else repr(found)
        raise CaptureError(
            self.path,
            where=f"key {short(self.full(key))}",
            expected=short(expected, 300),
            found=short(text),
            advice=None if advice is None else short(advice, 200),
        )

    def get(self, key: str) -> Any:
        """Whatever stands under a key, or None."""
        self._asked[key] = None
        return self.values.get(key)

    def table(self, key: str) -> Keys:
        """The table under a key; an empty one if there is none."""
        value = self.get(key)
        if value is not None and not isinstance(value, dict):
            self.fail(key, expected="a table", found=repr(value))
        return Keys(self.path, self.full(key), value or {})

    def text(self, key: str, default: str) -> str:
        """A string."""
        value = self.get(key)
        if value is None:
            return default
        if not isinstance(value, str):
            self.fail(key, expected="text in quotes", found=repr(value))
        return value

    def choice(self, key: str, choices: Sequence[str], default: str) -> str:
        """One of several words."""
        value = self.text(key, default)
        if value not in choices:
            near = difflib.get_close_matches(value, choices, n=1)
            self.fail(
                key,
                expected=f"one of {', '.join(choices)}",
                found=repr(value),
                advice=f"did you mean {near[0]!r}?" if near else None,
            )
        return value

    def whole(self, key: str, default: int, low: int, high: int) -> int:
        """A whole number within bounds."""
        value = self.get(key)
        if value is None:
            return default
        if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
            self.fail(key, expected=f"a whole number from {low} to {high}", found=repr(value))
        return value

    def number(self, key: str, low: float, high: float) -> float | None:
        """A number within bounds, or None if the key is not there."""
        value = self.get(key)
        if value is None:
            return None
        if not _is_number(value) or not low <= value <= high:
            self.fail(key, expected=f"a number from {low:g} to {high:g}", found=repr(value))
        return float(value)

    def numbers(self, key: str, count: int) -> tuple[float, ...] | None:
        """So many numbers of a sane size, or None if the key is not there."""
        value = self.get(key)
        if value is None:
            return None
        if not isinstance(value, list) or len(value) != count or not all(map(_is_sane, value)):
            self.fail(key, expected=f"{count} numbers", found=repr(value))
        return tuple(float(v) for v in value)

    def marks(self, key: str) -> tuple[str | float, ...]:
        """A list of texts and numbers as they may stand in a file; empty if the key is not there."""
        value = self.get(key)
        if value is None:
            return ()
        if not isinstance(value, list) or not all(isinstance(v, str) or _is_number(v) for v in value):
            self.fail(key, expected="a list of texts or numbers", found=repr(value))
        return tuple(v if isinstance(v, str) else float(v) for v in value)

    def column(self, key: str) -> Column | None:
        """A column by its name in the header or by its number from 1."""
        value = self.get(key)
        return None if value is None else self._column(key, value)

    def columns(self, key: str, count: int) -> tuple[Column, ...] | None:
        """So many columns, or None if the key is not there."""
        value = self.get(key)
        if value is None:
            return None
        if not isinstance(value, list) or len(value) != count:
            found = f"{len(value)}" if isinstance(value, list) else repr(value)
            self.fail(key, expected=f"a list of {count} columns", found=found)
        return tuple(self._column(key, item) for item in value)

    def finish(self) -> None:
        """Refuse what nobody asked for: a misspelt key must not be silently without effect."""
        for key in self.values:
            if key not in self._asked:
                near = difflib.get_close_matches(key, self._asked, n=1)
                self.fail(
                    key,
                    expected=f"one of {', '.join(self._asked)}",
                    found=repr(key),
                    advice=f"did you mean {near[0]!r}?" if near else None,
                )

    def _column(self, key: str, value: Any) -> Column:
        named = isinstance(value, str) and value.strip()
        numbered = isinstance(value, int) and not isinstance(value, bool) and 1 <= value <= MAX_COLUMNS
        if not (named or numbered):
            self.fail(
                key,
                expected=f"a column: its name in the header, or its number from 1 to {MAX_COLUMNS}",
                found=repr(value),
            )
        column: Column = value
        return column


def _is_sane(value: Any) -> bool:
    return _is_number(value) and abs(value) < _SANE


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < float("inf")
