"""Parse JSON text; every kind of damage becomes one clear error.

The standard library's parser is fast enough (measured: indented body-tracking files at 150 MB/s, within twice
the time of pandas' C parser on the same numbers), and its recursion is bounded.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.readers.base.source import Source

# Each comma separates two values. A value takes about 155 bytes with its object (measured), 380 where rows
# of a table are made of it: 1.2 to 3 GB in all. A person of 32 joints with orientations is 290 values per
# frame, so this is a quarter of an hour at 30 fps.
MAX_VALUES = 8_000_000


def parse_json(source: Source) -> Any:
    """The value of the JSON text; NaN and infinities are kept as floats.

    Raises CaptureError if the text is not JSON (with line and column), is cut off, is nested deeper than
    Python's stack, repeats a key within an object, or holds more than MAX_VALUES values.
    """
    values = source.content.count(b",")
    if values > MAX_VALUES:
        raise source.error(expected=f"JSON of at most {MAX_VALUES} values", found=f"{values}")
    try:
        return json.loads(source.text, object_pairs_hook=_without_repeats)
    except json.JSONDecodeError as error:
        raise source.error(
            expected="JSON",
            found=_lower_first(error.msg),
            where=f"line {error.lineno}, column {error.colno}",
            advice="the file is cut off there" if error.pos >= len(source.text.rstrip()) else None,
        ) from None
    except _RepeatedKeyError as error:
        raise source.error(expected="every key of an object once", found=f"{error.key!r} twice") from None
    except RecursionError:
        raise source.error(expected="JSON of a capture", found="brackets nested hundreds deep") from None
    except ValueError:
        # The remaining case: Python refuses integers of more than 4,300 digits.
        raise source.error(expected="numbers", found="a number with thousands of digits") from None


def numbers(value: Any) -> Array | None:
    """A (nested) list of numbers as an array, with null as NaN; None if it is ragged or holds anything else.

    Strings and booleans do not count as numbers.
    """
    try:
        array = np.array(value)
    except (ValueError, OverflowError):
        return None
    if array.dtype.kind == "O":
        # null, or integers beyond 64 bits; rare enough to check each item.
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


def _without_repeats(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """The object of these pairs; raises _RepeatedKeyError, as a repeated key is ambiguous."""
    result = dict(pairs)
    if len(result) != len(pairs):
        seen: set[str] = set()
        for key, _ in pairs:
            if key in seen:
                raise _RepeatedKeyError(key)
            seen.add(key)
    return result


def _lower_first(message: str) -> str:
    """The parser's message with a lower-case first letter, to continue our sentence."""
    return message[:1].lower() + message[1:]
