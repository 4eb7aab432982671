"""Counts in sentences."""

from __future__ import annotations


def several(count: int, noun: str) -> str:
    """The count with its noun, which takes a plain s: "1 frame", "2 frames"."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"
