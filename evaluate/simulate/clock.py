"""Real time: control steps at their rate, and how many were on time."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable

RESYNC = 0.5  # s behind, after which the clock gives up what it missed
LATELY = 10.0  # s of `lately_on_time`


class Clock:
    """Beats at `rate` Hz, times `speed` (slow motion below 1).

    beats, late: how many there were, and how many of them began after the next one was due.
    """

    def __init__(
        self,
        rate: float,
        *,
        now: Callable[[], float] = time.perf_counter,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self.rate, self.speed = rate, 1.0
        self.beats = self.late = 0
        self._now, self._sleep = now, sleep
        self._due = now()
        self._lately: deque[bool] = deque(maxlen=round(LATELY * rate))  # late or not

    @property
    def on_time(self) -> float:
        """Share of the beats that began before the next one was due."""
        return 1.0 - self.late / max(1, self.beats)

    @property
    def lately_on_time(self) -> float:
        """`on_time` over the last LATELY seconds."""
        return 1.0 - sum(self._lately) / max(1, len(self._lately))

    def wait(self) -> None:
        """Return when the next beat is due, at once if it was missed."""
        period = 1.0 / (self.rate * self.speed)
        remaining = self._due - self._now()
        if remaining > 0.0:
            self._sleep(remaining)
        behind = self._now() - self._due
        late = behind > period
        self.beats += 1
        self.late += late
        self._lately.append(late)
        self._due += period
        if behind > RESYNC:
            self._due = self._now() + period

    def restart(self) -> None:
        """After work of another kind: the next beat is due now."""
        self._due = self._now()
