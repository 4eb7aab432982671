"""The type of every option that takes a number with a fraction: finite, and within a range."""

from __future__ import annotations

import math
from typing import Any

import click


class FiniteRange(click.FloatRange):
    """A `click.FloatRange` that also rejects NaN and infinity."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The number; BadParameter, which names the option, for any other."""
        number = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"expected a finite number{self._within()}, found {value}", param, ctx)
        return number

    def _within(self) -> str:
        return f" in the range {self._describe_range()}" if (self.min, self.max) != (None, None) else ""
