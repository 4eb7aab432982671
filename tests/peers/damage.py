"""Single damages of JSON files, as by a hand, a disk or another program."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import numpy as np

Place = tuple[Any, Any]  # a container and a key or position in it
_VALUES: tuple[Any, ...] = (
    None, True, False, 0, -1, 3, 0.5, -2.5, 1e9, 1e308, -1e308, 2**63, 10**40, "", "x", "\u001b[2J", "\ud800",
    [],    {}, [[]], [None], {"a": 1}, "nan",
)  # fmt: skip
_TOKENS = (b"NaN", b"Infinity", b"1e999", b"-", b"'", b"[", b"}", b",", b"\x00", b"\xff", b"nul")


def damaged(content: bytes, rng: np.random.Generator) -> bytes:
    """The content with one damage."""
    kind = int(rng.integers(9))
    if kind == 0:
        return content[: int(rng.integers(len(content)))]
    if kind == 1:
        flipped = bytearray(content)
        flipped[int(rng.integers(len(flipped)))] ^= 1 << int(rng.integers(8))
        return bytes(flipped)
    if kind == 2:
        at = int(rng.integers(len(content)))
        return content[:at] + _TOKENS[int(rng.integers(len(_TOKENS)))] + content[at + 1 :]
    document = json.loads(content)
    places = list(_places(document))
    container, key = places[int(rng.integers(len(places)))]
    match kind:
        case 3:
            del container[key]
        case 4 if isinstance(container, dict):
            container[f"{key}_"] = container[key]
        case 5 if isinstance(container, dict):
            container[f"{key}_"] = container.pop(key)
        case 6 if isinstance(container[key], int | float) and not isinstance(container[key], bool):
            container[key] = (container[key] + 1) * float(rng.choice([-1.0, 1e3, 1e12, -1e300, 1e-300]))
        case 7 if isinstance(container[key], list):
            del container[key][int(rng.integers(len(container[key]) + 1)) :]
        case _:
            container[key] = _VALUES[int(rng.integers(len(_VALUES)))]
    return json.dumps(document).encode()


def _places(value: Any) -> Iterator[Place]:
    """Every value of a document with where it is; of a long list of numbers only the first and last."""
    if isinstance(value, dict):
        for key, item in value.items():
            yield value, key
            yield from _places(item)
    elif isinstance(value, list):
        positions = range(len(value)) if len(value) <= 30 else (0, 1, len(value) - 1)
        for position in positions:
            yield value, position
            yield from _places(value[position])
