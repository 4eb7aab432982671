"""What came from a file, against the types that their dataclasses declare."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

_LARGEST = 1 << 63  # numpy's whole numbers end there


def check_types(settings: Any, place: str = "") -> None:
    """ValueError names the first field of a dataclass whose value is not of its declared type.

    A float may be a whole number too.
    """
    hints = get_type_hints(type(settings))
    for field in fields(settings):
        value, name = getattr(settings, field.name), place + field.name
        if is_dataclass(value):
            check_types(value, f"{name}.")
        elif not _fits(value, hints[field.name]):
            raise ValueError(f"{name}: expected {field.type}, found {value!r}")


def _fits(value: Any, kind: Any) -> bool:
    origin, inside = get_origin(kind), get_args(kind)
    if origin in (Union, UnionType):
        found = any(_fits(value, one) for one in inside)
    elif origin is Literal:
        found = value in inside
    elif origin is dict:
        found = isinstance(value, dict) and all(
            _fits(name, inside[0]) and _fits(item, inside[1]) for name, item in value.items()
        )
    elif origin is tuple:
        kinds = inside[:1] * len(value) if inside[1:] == (...,) and isinstance(value, tuple) else inside
        found = isinstance(value, tuple) and len(value) == len(kinds) and all(map(_fits, value, kinds))
    elif is_dataclass(kind):
        hints = get_type_hints(kind)
        found = type(value) is kind and all(
            _fits(getattr(value, f.name), hints[f.name]) for f in fields(kind)
        )
    elif origin is list:
        found = isinstance(value, list) and all(_fits(item, inside[0]) for item in value)
    elif kind in (int, float) and type(value) is int:
        found = -_LARGEST <= value < _LARGEST
    else:
        found = type(value) is kind
    return found
