"""Option types for the length of a training run: samples such as 1M, and minutes."""

from __future__ import annotations

from decimal import Decimal

import click

from kinemimic.pipeline.cli.finite_range import FiniteRange

_MOST = Decimal(10) ** 15
_SUFFIXES = {"k": Decimal(10) ** 3, "m": Decimal(10) ** 6, "g": Decimal(10) ** 9}


def samples(value: str) -> int:
    """A whole number of at least 1 in any notation: 1M, 2.5M, 300k, 5e5, 500000, 500_000."""
    text = value.strip()
    factor = _SUFFIXES.get(text[-1:].lower())
    try:
        # Decimal, because 1.1 * 1e6 is not a whole number in binary.
        number = Decimal(text if factor is None else text[:-1]) * (factor or 1)
    except ArithmeticError:  # no number, or beyond all exponents
        number = Decimal(0)
    if not (number.is_finite() and 1 <= number <= _MOST and number == number.to_integral_value()):
        raise click.BadParameter(
            f"expected a whole number of samples such as 1M, 300k or 1e6, found {value!r}"
        )
    return int(number)


def short(count: int) -> str:
    """A number of samples to two significant digits, as `samples` reads it: 1M, 2.5M, 300k."""
    rounded = int(float(f"{count:.2g}"))
    for suffix, factor in (("M", 10**6), ("k", 10**3)):
        if rounded >= factor:
            return f"{rounded / factor:.12g}{suffix}"
    return str(rounded)


MINUTES = FiniteRange(min=0.0, min_open=True)
