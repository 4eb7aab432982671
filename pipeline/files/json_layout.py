"""JSON layout for human readers: one line for each key and each innermost list."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any


def layout(value: Any, indent: str = "") -> str:
    """JSON text in fewer lines than `json.dumps(indent=2)`, which puts every number on its own line."""
    inner = indent + "  "
    if isinstance(value, Mapping) and value:
        lines = [f"{json.dumps(key)}: {layout(item, inner)}" for key, item in value.items()]
        opening, closing = "{}"
    elif isinstance(value, list | tuple) and any(isinstance(item, list | tuple | Mapping) for item in value):
        lines = [layout(item, inner) for item in value]
        opening, closing = "[]"
    else:
        return json.dumps(value, allow_nan=False)
    return opening + "\n" + ",\n".join(inner + line for line in lines) + f"\n{indent}{closing}"


def rounded(value: Any, digits: int) -> float | None:
    """A number for JSON with `digits` decimals: no minus zero, None if it is not finite."""
    return round(float(value), digits) + 0.0 if math.isfinite(value) else None
