"""Defer Ctrl-C, SIGTERM and SIGHUP (the terminal was closed) while work must not be interrupted.

The first signal is recorded, the second interrupts.
"""

from __future__ import annotations

import contextlib
import os
import signal
import stat
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Interruption:
    """asked: whether to stop at the next safe point."""

    def __init__(self) -> None:
        self.asked = False

    def note(self, number: int = 0, _frame: FrameType | None = None) -> None:
        """The signal handler; raises KeyboardInterrupt at the second signal."""
        if number == signal.SIGHUP:
            # Shell and kernel may both send one: further ones are not a second request.
            _leave_the_terminal()
        elif self.asked:
            raise KeyboardInterrupt
        self.asked = True


@contextmanager
def deferred() -> Iterator[Interruption]:
    """Send SIGINT, SIGTERM and SIGHUP to the Interruption that this yields; restore the handlers afterwards.

    Only the main thread may set handlers; in any other thread, no signal is caught. A signal that is ignored
    stays ignored, as SIGINT is for a job in the background, and SIGHUP under `nohup`.
    """
    interruption = Interruption()
    if threading.current_thread() is not threading.main_thread():
        yield interruption
        return
    heeded = (n for n in SIGNALS if signal.getsignal(n) != signal.SIG_IGN)
    earlier = {number: signal.signal(number, interruption.note) for number in heeded}
    try:
        yield interruption
    finally:
        for number, handler in earlier.items():
            signal.signal(number, handler)


@contextmanager
def ended_by_sigterm() -> Iterator[None]:
    """Let SIGTERM end the block with SystemExit, so that it cleans up; without, it would kill the process.

    Only in the main thread, and where nothing else heeds the signal. Processes that are forked within the
    block keep the default.
    """
    if (
        threading.current_thread() is not threading.main_thread()
        or signal.getsignal(signal.SIGTERM) != signal.SIG_DFL
    ):
        yield
        return
    owner = os.getpid()

    def end(number: int, _frame: FrameType | None) -> None:
        if os.getpid() == owner:
            raise SystemExit(128 + number)
        signal.signal(number, signal.SIG_DFL)
        os.kill(os.getpid(), number)

    signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _leave_the_terminal() -> None:
    """Point stdout and stderr to nowhere if they are terminals: writing to one that was closed fails."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for number in (1, 2):
        # For isatty, a closed terminal is not a terminal any more, but it is still a device.
        with contextlib.suppress(OSError):
            if stat.S_ISCHR(os.fstat(number).st_mode):
                os.dup2(nowhere, number)
    os.close(nowhere)
