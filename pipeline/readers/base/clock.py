"""The clock of a table whose unit of time is in the column's name, or must be told from its steps."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

import numpy as np

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.readers.base.frame_defects import increasing_times
from kinemimic.pipeline.readers.base.source import Source

# Unit -> seconds, and how a column's name says it.
UNITS: dict[str, float] = {"s": 1.0, "ms": 1e-3, "µs": 1e-6, "ns": 1e-9}
_NAMED: tuple[tuple[str, re.Pattern[str]], ...] = (
    ("ns", re.compile(r"\bns\b|nanos", re.IGNORECASE)),
    ("µs", re.compile(r"\b[uµμ]s\b|[uµμ]sec|micros", re.IGNORECASE)),
    ("ms", re.compile(r"\bms\b|msec|millis", re.IGNORECASE)),
    ("s", re.compile(r"\bs\b|\bsec(onds?)?\b", re.IGNORECASE)),
)
_CLOCK = re.compile(r"time|stamp", re.IGNORECASE)
# Limits of a camera's median step in seconds: 500 Hz to one picture in half a second. Units are a thousand
# times apart, so that no step fits two of them.
STEPS = (0.002, 0.5)


def clock_column(names: Sequence[str]) -> int | None:
    """The first column whose name says that it holds times, or None."""
    return next((k for k, name in enumerate(names) if _CLOCK.search(name)), None)


def named_unit(name: str) -> str | None:
    """The unit (a key of UNITS) that a column's name states, as in "Time (ms)" or "timestamp_us", or None."""
    words = name.replace("_", " ")
    return next((unit for unit, pattern in _NAMED if pattern.search(words)), None)


def seconds_of(
    clock: Array, name: str, source: Source, where: Callable[[int], str]
) -> tuple[Array, Mask, list[Defect], str]:
    """Times in seconds of the frames to keep, their mask (T,), the defects, and the unit.

    clock: (T,) as in the file; name: of its column; where: place of a frame in the file. Raises CaptureError
    for a time that is not finite, and for a median step that no camera has in any unit, or in the one that
    the name states.
    """
    wrong = ~(np.abs(clock) < 2.0**63)  # NaN too
    if wrong.any():
        row = int(np.argmax(wrong))
        raise source.error(expected=f"a time in {name[:40]}", found=f"{clock[row]:g}", where=where(row))
    later, defects = increasing_times(clock)
    kept = clock[later]
    step = float(np.median(np.diff(kept))) if len(kept) > 1 else 0.0
    stated = named_unit(name)
    possible = [stated] if stated else list(UNITS)
    unit = next((key for key in possible if STEPS[0] <= step * UNITS[key] <= STEPS[1]), None)
    if unit is None:
        raise source.error(
            expected=f"times with steps of {1e3 * STEPS[0]:g} to {1e3 * STEPS[1]:g} ms in {name[:40]}",
            found=f"a median step of {step:.4g}{f' {stated}' if stated else ''} over {len(kept)} frames",
        )
    return kept * UNITS[unit], later, defects, unit
