"""Which moment of a live capture is due: the newest frame less the lag, at an even pace.

The time between frames wavers, and a network delays some; the lag is the buffer for both. The pace is that of
the simulation and follows the sender's clock slowly.
"""

from __future__ import annotations

# Share of a lag's deviation that the pace makes up for in a second, and the largest change of the pace.
GAIN, MAX_CHANGE = 0.3, 0.05
AVERAGED = 1.0  # s over which the deviation is averaged
# Seconds behind the lag beyond which playback skips to the newest frame.
BEHIND = 0.5


class Playout:
    """Seconds on the sender's clock, one for every `step` seconds of simulation.

    lag: wanted, s; skips: number of skips to the newest frame.
    """

    def __init__(self, lag: float, step: float) -> None:
        self.lag, self.step, self.skips = lag, step, 0
        self._at: float | None = None
        self._off = 0.0

    def advance(self, newest: float | None) -> float | None:
        """The moment that is due, at most `newest`, the time of the newest frame; None if there is none."""
        if newest is None:
            self._at = None
            return None
        if self._at is None or newest < self._at - BEHIND or newest - self._at > self.lag + BEHIND:
            self.skips += self._at is not None
            self._at, self._off = newest - self.lag, 0.0
            return self._at
        self._off += self.step / AVERAGED * (newest - self._at - self.step - self.lag - self._off)
        pace = 1.0 + min(max(GAIN * self._off, -MAX_CHANGE), MAX_CHANGE)
        due = self._at + pace * self.step
        if due > newest + 1e-9:
            return None
        self._at = due
        return due
