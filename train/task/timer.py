"""A timer that assigns all wall time to names, so that the parts add up to the total."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

Seconds = Mapping[str, float]


class Timer:
    """seconds: of each name so far; clock: returns seconds from any origin."""

    def __init__(self, clock: Callable[[], float] = time.perf_counter) -> None:
        self.seconds: dict[str, float] = {}
        self._clock = clock
        self._last = clock()

    def restart(self) -> None:
        """Start over with no seconds for any name."""
        self.seconds = {}
        self._last = self._clock()

    def lap(self, name: str) -> float:
        """Assign all time since the last lap to `name`, and return it, s."""
        now = self._clock()
        spent, self._last = now - self._last, now
        self.seconds[name] = self.seconds.get(name, 0.0) + spent
        return spent


def summed(*parts: Seconds) -> dict[str, float]:
    """The sum for each name."""
    names = dict.fromkeys(name for part in parts for name in part)
    return {name: sum(part.get(name, 0.0) for part in parts) for name in names}


def split(seconds: Seconds, name: str, parts: Seconds, rest: str) -> dict[str, float]:
    """`seconds` with `name` replaced by its parts and the `rest` of it."""
    others = {key: value for key, value in seconds.items() if key != name}
    return {**parts, rest: seconds.get(name, 0.0) - sum(parts.values()), **others}


def table(seconds: Seconds) -> str:
    """For a terminal, the largest first: seconds, share of the total, and seconds per minute."""
    total = sum(seconds.values())
    rows = [*sorted(seconds.items(), key=lambda item: -item[1]), ("together", total)]
    width = max(len(name) for name, _ in rows)
    lines = [f"{'':{width}} {'seconds':>9} {'share':>7} {'of a minute':>12}"]
    for name, value in rows:
        share = value / total if total > 0.0 else 0.0
        lines.append(f"{name:{width}} {value:9.1f} {100 * share:5.1f} % {60 * share:10.1f} s")
    return "\n".join(lines)
