"""JSON as the standard has it: Python's parser takes NaN too, and what is nested deep is too much for it."""

from __future__ import annotations

import json
import math
from typing import Any


def plain_json(text: str, *, finite: bool = True) -> Any:
    """The value of a JSON text; ValueError says what is wrong with it.

    finite: no NaN or infinity, also none written as 1e999: what is read is written again, where that is
    refused.
    """
    number = _finite if finite else float
    try:
        return json.loads(text, parse_constant=number, parse_float=number)
    except RecursionError:
        raise ValueError("lists or objects that are nested too deep") from None


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{text}, which is no number of JSON's")
    return value
