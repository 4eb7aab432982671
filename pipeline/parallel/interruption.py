"""Ctrl-C and SIGTERM while something must not be cut in two: the first one is noted, the second one acts."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


class Interruption:
    """asked: whether to stop at the next good moment."""

    def __init__(self) -> None:
        self.asked = False

    def note(self, _number: int = 0, _frame: FrameType | None = None) -> None:
        """What a signal calls; KeyboardInterrupt at once if it was asked before."""
        if self.asked:
            raise KeyboardInterrupt
        self.asked = True


@contextmanager
def deferred() -> Iterator[Interruption]:
    """SIGINT and SIGTERM go to the Interruption that this yields; the earlier handlers come back behind it.

    In another thread than the main one, which alone may set handlers, nothing is caught; and a signal that
    is ignored stays so, as that of a job in the background, which Ctrl-C is not meant for.
    """
    interruption = Interruption()
    if threading.current_thread() is not threading.main_thread():
        yield interruption
        return
    heeded = (n for n in (signal.SIGINT, signal.SIGTERM) if signal.getsignal(n) != signal.SIG_IGN)
    earlier = {number: signal.signal(number, interruption.note) for number in heeded}
    try:
        yield interruption
    finally:
        for number, handler in earlier.items():
            signal.signal(number, handler)
