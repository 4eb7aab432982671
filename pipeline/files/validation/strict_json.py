"""Strict JSON: unlike Python's parser, refuse NaN and report too deep nesting as a ValueError."""

from __future__ import annotations

import json
import math
from typing import Any

import msgspec

from kinemimic.pipeline.files.validation.place import found_at


def strict_json(text: str, *, finite: bool = True) -> Any:
    """The value of a JSON text; ValueError, which says what was found and where, if it is not valid.

    finite: refuse NaN and infinity, including 1e999, since the value may be written again, where they are
    refused.
    """
    if finite:
        try:
            # As strict, and three times as fast, but its messages name neither line nor value.
            return msgspec.json.decode(text)
        except (msgspec.DecodeError, RecursionError):
            pass
    number = _finite if finite else float
    try:
        return json.loads(text, parse_constant=number, parse_float=number)
    except RecursionError:
        raise ValueError("lists or objects that are nested too deep") from None
    except json.JSONDecodeError as error:
        raise ValueError(found_at(text, error.lineno, error.colno)) from None
    except _NotFiniteError:
        raise
    except ValueError:
        # The remaining case: int() refuses thousands of digits.
        raise ValueError("a number with thousands of digits") from None


class _NotFiniteError(ValueError):
    """NaN or infinity."""


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise _NotFiniteError(f"{text}, which is not a JSON number")
    return value
