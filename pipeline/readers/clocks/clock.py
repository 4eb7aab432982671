"""The clock of a table or of JSON: which column or key holds times, and their unit, which is in its name or
must be told from its steps.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.readers.base.column_names import words_of
from kinemimic.pipeline.readers.base.frame_defects import increasing_times
from kinemimic.pipeline.readers.base.source import Source

# Unit -> seconds, and how a column's name says it.
UNITS: dict[str, float] = {"s": 1.0, "ms": 1e-3, "µs": 1e-6, "100ns": 1e-7, "ns": 1e-9}
_NAMED: tuple[tuple[str, re.Pattern[str]], ...] = (
    ("100ns", re.compile(r"\bticks?\b|\b100 ?ns\b", re.IGNORECASE)),
    ("ns", re.compile(r"\bns\b|nanos", re.IGNORECASE)),
    ("µs", re.compile(r"\b[uµμ]s\b|[uµμ]sec|micros", re.IGNORECASE)),
    ("ms", re.compile(r"\bms\b|msec|millis", re.IGNORECASE)),
    ("s", re.compile(r"\bs\b|\bsec(onds?)?\b", re.IGNORECASE)),
)
_CLOCK = re.compile(r"time|stamp", re.IGNORECASE)
# A name of nothing but these words is a clock's, too; of nothing but times and units, it claims to be one.
_TIMES = frozenset(("time", "times", "timestamp", "timestamps", "stamp"))
_UNIT_WORDS = frozenset((
    "s", "sec", "secs", "second", "seconds", "ms", "msec", "millis", "millisecond", "milliseconds",
    "us", "usec", "micros", "microseconds", "ns", "nanos", "nanoseconds",
))  # fmt: skip
_ELAPSED = frozenset(("t", "elapsed", "clock"))
# Names of a frame rate, their words joined.
_RATES = frozenset((
    "fps", "videofps", "framerate", "videoframerate", "mocapframerate", "samplerate", "samplingrate",
    "samplingfrequency",
))  # fmt: skip
# Share of a clock's steps that go forward: recordings may be joined, or be of one person after the other.
_FORWARD = 0.8
# Limits of a camera's median step in seconds: 500 Hz to one picture in half a second. Of two units that a
# step fits (ticks of 100 ns and µs), it is in the one in which it is nearer to the usual one.
STEPS = (0.002, 0.5)
_USUAL_STEP = 1.0 / 30.0


def clock_column(names: Sequence[str]) -> int | None:
    """The first column whose name says that it holds times, or None."""
    return next((k for k, name in enumerate(names) if _CLOCK.search(name)), None)


def says_time(name: str) -> bool:
    """Whether a column or key calls itself a time: "Time (ms)", "timestampSec", "t", "elapsed_ms"."""
    words = set(words_of(name))
    return _CLOCK.search(name) is not None or (bool(words) and words <= _UNIT_WORDS | _ELAPSED)


def is_rate(name: str) -> bool:
    """Whether a column or key calls itself a frame rate: "fps", "videoFrameRate"."""
    return "".join(words_of(name)) in _RATES


def clock_of(columns: Mapping[str, Array]) -> str | None:
    """The name of the column that holds times, or None. columns: name -> values (T,).

    Of those that call themselves a time, it is the first that runs forward in a camera's steps: the duration
    of every frame does not. Without one, it is the first that runs forward in other steps, or that is called
    nothing but a time; `seconds_of` says what is wrong with it.
    """
    steps = {name: _step(clock) for name, clock in columns.items() if says_time(name)}
    for name, step in steps.items():
        if _unit_of(step, name) is not None:
            return name
    for name, step in steps.items():
        words = set(words_of(name))
        if words & _TIMES and (step > 0.0 or words <= _TIMES | _UNIT_WORDS):
            return name
    return None


def _step(clock: Array) -> float:
    """The usual step of a clock (T,); 0 if it does not run forward."""
    with np.errstate(over="ignore", invalid="ignore"):  # a damaged file may hold any number
        steps = np.diff(clock[np.isfinite(clock)])
    # Several rows may be of the same time.
    steps = steps[steps != 0.0]
    forward = steps > 0.0
    return float(np.median(steps[forward])) if len(steps) and forward.mean() >= _FORWARD else 0.0


def _unit_of(step: float, name: str) -> str | None:
    """The unit in which a step is a camera's: the one that the name states, or any; None if there is none."""
    stated = named_unit(name)
    possible = [stated] if stated else list(UNITS)
    fitting = [unit for unit in possible if STEPS[0] <= step * UNITS[unit] <= STEPS[1]]
    return min(fitting, key=lambda unit: abs(math.log(step * UNITS[unit] / _USUAL_STEP)), default=None)


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
    unit = _unit_of(step, name)
    if unit is None:
        stated = named_unit(name)
        raise source.error(
            expected=f"times with steps of {1e3 * STEPS[0]:g} to {1e3 * STEPS[1]:g} ms in {name[:40]}",
            found=f"a median step of {step:.4g}{f' {stated}' if stated else ''} over {len(kept)} frames",
        )
    return kept * UNITS[unit], later, defects, unit
