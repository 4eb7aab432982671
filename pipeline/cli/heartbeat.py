"""A line on stderr at least every 15 s while a command runs, so that no log is silent for long."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

# A line is late if one call holds the interpreter for seconds; a log must not be silent for more than 20 s.
INTERVAL = 15.0

Line = Callable[[], str]


class _Heartbeat:
    """A thread that prints the innermost of the `tasks` whenever `INTERVAL` seconds passed without a line."""

    def __init__(self) -> None:
        self.tasks: tuple[Line, ...] = ()
        self._last = time.monotonic()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="heartbeat", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        self._over.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._over.wait(max(0.0, self._last + INTERVAL - time.monotonic())):
            line = self.tasks[-1]() if self.tasks else ""
            if line:
                try:
                    print(line, file=sys.stderr, flush=True)
                except (OSError, ValueError):  # nobody reads stderr any more
                    return
            self._last = time.monotonic()


_running: _Heartbeat | None = None


@contextmanager
def heartbeat(line: Line) -> Iterator[None]:
    """Within this block, stderr gets `line()` every 15 s, unless it is "" or a block inside has its own.

    The thread only reads, so it cannot change a result; `line` is called from it.
    """
    global _running  # noqa: PLW0603 (a process has one stderr)
    outermost = _running is None
    beat = _running or _Heartbeat()
    earlier = beat.tasks
    beat.tasks = (*earlier, line)
    if outermost:
        _running = beat
        beat.start()
    try:
        yield
    finally:
        beat.tasks = earlier
        if outermost:
            _running = None
            beat.stop()


def running_for(what: str) -> Line:
    """A line for a task without a measure of its progress: `ingest: running for 45 s`."""
    began = time.monotonic()
    return lambda: f"{what}: running for {time.monotonic() - began:.0f} s"
