"""Defer Ctrl-C and SIGTERM while work must not be interrupted.

The first signal is recorded, the second interrupts.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


class Interruption:
    """asked: whether to stop at the next safe point."""

    def __init__(self) -> None:
        self.asked = False

    def note(self, _number: int = 0, _frame: FrameType | None = None) -> None:
        """The signal handler; raises KeyboardInterrupt at the second signal."""
        if self.asked:
            raise KeyboardInterrupt
        self.asked = True


@contextmanager
def deferred() -> Iterator[Interruption]:
    """Send SIGINT and SIGTERM to the Interruption that this yields; restore the earlier handlers afterwards.

    Only the main thread may set handlers; in any other thread, no signal is caught. A signal that is ignored
    stays ignored, as SIGINT is for a job in the background.
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
