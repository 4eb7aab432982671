"""Numbers as attributes of MJCF and URDF."""

from __future__ import annotations


def number_text(*values: float) -> str:
    """The values with nine significant digits, separated by blanks."""
    return " ".join(f"{value:.9g}" for value in values)
