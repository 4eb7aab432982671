"""Pieces of TOML text: names, quoted where necessary; columns by name or number; long lists, wrapped."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence


def quoted(text: str) -> str:
    """A text in quotes; JSON's escapes are TOML's too."""
    return json.dumps(text, ensure_ascii=False)


def key(name: str) -> str:
    """A key, without quotes if TOML allows it."""
    return name if name.replace("_", "").isalnum() and name.isascii() else quoted(name)


def column(names: Sequence[str], index: int) -> str:
    """A column, counted from 0: its name if that is unique, else its number, counted from 1."""
    named = names and names[index] and names.count(names[index]) == 1
    return quoted(names[index]) if named else str(index + 1)


def one_or_list(items: Sequence[str], *, single: bool) -> str:
    """The only item, or a list of all."""
    return items[0] if single else f"[{', '.join(items)}]"


def folded(name: str, items: Sequence[str], most: int = 100) -> Iterator[str]:
    """The lines of a list under a key."""
    yield f"{name} = ["
    line = "   "
    for item in items:
        if len(line) + len(item) + 2 > most:
            yield line
            line = "   "
        line += f" {item},"
    yield line
    yield "]"
