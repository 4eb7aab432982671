"""Option types for the length of a training: samples such as 1e6, and minutes."""

from __future__ import annotations

import click


def samples(value: str) -> int:
    """A whole number of at least 1 in any notation: 500000, 5e5, 500_000."""
    try:
        number = float(value)
    except ValueError:
        number = 0.0
    if not (number >= 1.0 and number.is_integer()):
        raise click.BadParameter(f"expected a whole number of samples such as 1e6, found {value!r}")
    return int(number)


MINUTES = click.FloatRange(min=0.0, min_open=True)
