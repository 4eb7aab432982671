"""JSON that people read: a line for each key and each frame."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any


def layout(value: Any, indent: str = "") -> str:
    """JSON with a line for each key and frame, where `json.dumps(indent=2)` gives every number its own."""
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
