"""A count with its noun."""

from __future__ import annotations


def plural(count: int, noun: str, several: str | None = None) -> str:
    """The count with its noun: "1 frame", "2 frames"; several: the plural of an irregular one."""
    return f"{count} {noun if count == 1 else several or f'{noun}s'}"
