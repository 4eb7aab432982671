"""How far a task is: what bars, logs and callbacks show."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

PERCENT = "%"  # as the unit of a bar whose count says nothing


@dataclass(frozen=True)
class ProgressState:
    """How far a task is.

    what: its name, such as `train`; done, total: in `unit` ("" for a plain count, "%" for a share), total
    math.inf if unknown; seconds: since this call began it; left: estimate of the seconds left, None before
    there is one; per_second: units, None before there is an estimate; notes: the latest numbers, such as the
    mean reward.
    `str(state)` is one line.
    """

    what: str
    done: float
    total: float
    unit: str = ""
    seconds: float = 0.0
    left: float | None = None
    per_second: float | None = None
    notes: Mapping[str, object] = field(default_factory=dict)

    @property
    def share(self) -> float:
        """Between 0 and 1; 1 for a task of nothing, 0 if the total is unknown."""
        return min(1.0, self.done / self.total) if self.total > 0 else 1.0

    @property
    def percent(self) -> str:
        """`39 %`, or "" if the total is unknown."""
        return f"{100 * self.share:.0f} %" if math.isfinite(self.total) else ""

    @property
    def count(self) -> str:
        """`393,216 of 1,000,000 samples`, `393,216 samples` if the total is unknown, or "" if only the share
        is of interest."""
        if self.unit == PERCENT:
            return ""
        if not math.isfinite(self.total):
            return f"{self.done:,.0f} {self.unit}".rstrip()
        return f"{self.done:,.0f} of {self.total:,.0f} {self.unit}".rstrip()

    @property
    def remaining(self) -> str:
        """`2:10 left`, or the time that a finished task took, or "" if unknown."""
        if self.done >= self.total:
            return f"took {minutes(self.seconds)}"
        return "" if self.left is None else f"{minutes(self.left)} left"

    @property
    def noted(self) -> str:
        """The notes: `reward 0.71, upright 600/600`."""
        return ", ".join(
            f"{k} {v:.3g}" if isinstance(v, float) else f"{k} {v}" for k, v in self.notes.items()
        )

    def __str__(self) -> str:
        facts = (self.percent, self.count, self.remaining)
        notes = f"; {self.noted}" if self.notes else ""
        return f"{self.what}: {', '.join(filter(None, facts))}{notes}"


def minutes(seconds: float) -> str:
    """A duration as m:ss or h:mm:ss."""
    total = round(seconds)
    hours, rest = divmod(total, 3600)
    return f"{hours}:{rest // 60:02d}:{rest % 60:02d}" if hours else f"{rest // 60}:{rest % 60:02d}"
