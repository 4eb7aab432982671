"""JSON to Python values, with every kind of damage as one clear error.

The standard library's parser is fast enough (measured: indented body-tracking files at 150 MB/s, within twice
the time of pandas' C parser on the same numbers), and its recursion is bounded.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.readers.base.source import Source

# Every comma parts two values, and a value takes at most about 64 bytes of memory: a file can ask for half a
# gigabyte. A person of 32 joints with orientations is 290 values a frame: a quarter of an hour at 30 fps.
MAX_VALUES = 8_000_000


def parse_json(source: Source) -> Any:
    """The value that the text holds; NaN and infinities pass as the floats they are.

    CaptureError for what is no JSON (with line and column), is cut off, is nested deeper than Python's own
    stack, has a key twice in an object or holds more than MAX_VALUES values.
    """
    values = source.content.count(b",")
    if values > MAX_VALUES:
        raise source.error(expected=f"JSON of at most {MAX_VALUES} values", found=f"{values}")
    try:
        return json.loads(source.text, object_pairs_hook=_once)
    except json.JSONDecodeError as error:
        raise source.error(
            expected="JSON",
            found=_said(error.msg),
            where=f"line {error.lineno}, column {error.colno}",
            advice="the file is cut off there" if error.pos >= len(source.text.rstrip()) else None,
        ) from None
    except _RepeatedKeyError as error:
        raise source.error(expected="every key of an object once", found=f"{error.key!r} twice") from None
    except RecursionError:
        raise source.error(expected="JSON of a capture", found="brackets nested hundreds deep") from None
    except ValueError:
        # The one that is left: Python refuses to read an integer of more than 4,300 digits.
        raise source.error(expected="numbers", found="one of thousands of digits") from None


def numbers(value: Any) -> Array | None:
    """A (nested) list of numbers as an array, null as NaN; None if it is ragged or holds anything else.

    Text that looks like a number and true and false are no numbers.
    """
    try:
        array = np.array(value)
    except (ValueError, OverflowError):
        return None
    if array.dtype.kind == "O":
        # null, or integers beyond 64 bits; rare enough to look at each.
        kinds = (int, float, type(None))
        if any(isinstance(item, bool) or not isinstance(item, kinds) for item in array.flat):
            return None
        try:
            return np.asarray(array, dtype=np.float64)
        except OverflowError:
            return None
    return np.asarray(array, dtype=np.float64) if array.dtype.kind in "fiu" else None


class _RepeatedKeyError(Exception):
    def __init__(self, key: str) -> None:
        self.key = key[:40]


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """The object of these pairs; of two values under one key nobody can say which is meant."""
    made = dict(pairs)
    if len(made) != len(pairs):
        seen: set[str] = set()
        for key, _ in pairs:
            if key in seen:
                raise _RepeatedKeyError(key)
            seen.add(key)
    return made


def _said(message: str) -> str:
    """The parser's message as the middle of our sentence: "expecting value"."""
    return message[:1].lower() + message[1:]
