"""The keys of a TOML table, asked for by name and type; a mistake is one line that names the key."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

from kinemimic.pipeline.errors import CaptureError

Column = str | int

# More columns than any recorder writes: a Kinect v2 with everything has some 300.
MAX_COLUMNS = 10_000
# Larger numbers than this are no lengths in any unit.
_SANE = 1e6


def short(text: str, most: int = 80) -> str:
    """A text on one line, cut to what a message can hold."""
    line = " ".join(text.split())
    return line if len(line) <= most else f"{line[: most - 2]} …"


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
