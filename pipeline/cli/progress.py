"""Progress of long tasks: name, share done, time left.

On a terminal, bars on stderr (`progress_bars.py`); elsewhere, a line on stderr every 15 s
(`heartbeat.py`); in Python, calls of your own function:

    with reported_to(lambda state: print(state)):
        train(run)
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

import click
from rich.console import Console

from kinemimic.pipeline.cli.heartbeat import heartbeat, running_for
from kinemimic.pipeline.cli.progress_bars import drawn
from kinemimic.pipeline.cli.progress_state import ProgressState

Clock = Callable[[], float]
# Called with the state of a task whenever it changes.
ProgressCallback = Callable[[ProgressState], object]
_callback: ContextVar[ProgressCallback | None] = ContextVar("callback", default=None)


class Bar:
    """The progress of one task."""

    def __init__(
        self, what: str, total: float, *, done: float, unit: str, changed: Callable[[], object], clock: Clock
    ) -> None:
        self._what, self._total, self._unit = what, total, unit
        self._done = self._before = done
        self._changed, self._clock = changed, clock
        self._notes: dict[str, object] = {}
        self._began = clock()
        self._deadline: float | None = None

    def advance(self, n: float = 1, **notes: object) -> None:
        """Advance by n units; `notes` (reward=0.83) are shown until replaced."""
        self._done += n
        # A new dictionary: other threads may be reading the old one.
        self._notes = {**self._notes, **notes}
        self._changed()

    def resumed(self, n: float) -> None:
        """n more units were done before this task began: they do not count towards the time left."""
        self._done += n
        self._before += n
        self._changed()

    def ends_within(self, seconds: float) -> None:
        """The task ends after at most this many seconds from now, even if it is not done."""
        self._deadline = self._clock() + seconds

    def corrected(self, total: float) -> None:
        """The total was an estimate, and is this instead; math.inf if it is now unknown."""
        self._total = total
        self._changed()

    @property
    def state(self) -> ProgressState:
        """The state now."""
        now = self._clock()
        spent, new = now - self._began, self._done - self._before
        per_second = new / spent if new > 0 and spent > 0 else None
        to_do = max(0.0, self._total - self._done)
        estimates = [] if per_second is None or math.isinf(to_do) else [to_do / per_second]
        if self._deadline is not None:
            estimates.append(max(0.0, self._deadline - now))
        return ProgressState(
            what=self._what,
            done=self._done,
            total=self._total,
            unit=self._unit,
            seconds=spent,
            left=min(estimates, default=None),
            per_second=per_second,
            notes=self._notes,
        )


class Bars:
    """Several bars, one below the other; a log and a callback get only the first."""

    def __init__(self, callback: ProgressCallback | None, clock: Clock = time.monotonic) -> None:
        self._callback, self._clock = callback, clock
        self._bars: tuple[Bar, ...] = ()

    def add(self, what: str, total: float, *, done: float = 0.0, unit: str = "") -> Bar:
        """Add a bar up to `total` units; done: before this call, and so without effect on the time left."""
        bar = Bar(what, total, done=done, unit=unit, changed=lambda: self._changed(bar), clock=self._clock)
        self._bars += (bar,)
        return bar

    def remove(self, bar: Bar) -> None:
        """Remove a bar."""
        self._bars = tuple(one for one in self._bars if one is not bar)

    def say(self, text: str) -> None:
        """Print a line to stderr, above the bars if there are any."""
        click.echo(text, err=True)

    def states(self) -> list[ProgressState]:
        """Of all bars."""
        return [bar.state for bar in self._bars]

    def line(self) -> str:
        """For a log; "" without a bar."""
        return str(self._bars[0].state) if self._bars else ""

    def _changed(self, bar: Bar) -> None:
        if self._callback is not None and bar is self._bars[0]:
            self._callback(bar.state)


class _DrawnBars(Bars):
    """Bars on a terminal."""

    def __init__(self, console: Console) -> None:
        super().__init__(None)
        self._console = console

    def say(self, text: str) -> None:
        self._console.print(text, markup=False, highlight=False, soft_wrap=True)


@contextmanager
def bars() -> Iterator[Bars]:
    """Several bars; silent if the command has --json."""
    callback = _callback.get()
    if callback is not None or _json_requested():
        yield Bars(callback)
        return
    console = Console(stderr=True)
    if console.is_terminal and not console.is_dumb_terminal:
        several = _DrawnBars(console)
        # The heartbeat is quiet while bars are drawn.
        with heartbeat(str), drawn(several.states, console):
            yield several
        return
    plain = Bars(None)
    with heartbeat(plain.line):
        yield plain


@contextmanager
def progress(what: str, total: float, *, done: float = 0.0, unit: str = "") -> Iterator[Bar]:
    """A bar up to `total` units: `with progress("train", budget) as bar: bar.advance(4096, reward=0.8)`.

    total: math.inf if unknown; done: units that were done before this call; unit: their name, or PERCENT.
    Silent if the command has --json.
    """
    with bars() as several:
        yield several.add(what, total, done=done, unit=unit)


@contextmanager
def activity(what: str) -> Iterator[None]:
    """Name a long step whose progress cannot be measured, for the log; bars inside it take precedence."""
    if _callback.get() is not None or _json_requested():
        yield
        return
    with heartbeat(running_for(what)):
        yield


@contextmanager
def reported_to(callback: ProgressCallback | None) -> Iterator[None]:
    """Within this block, nothing is drawn or printed: the callback gets a `ProgressState` at every change.

    An exception from the callback ends the task. With None as the callback, the block has no effect.
    """
    if callback is None:
        yield
        return
    token = _callback.set(callback)
    try:
        yield
    finally:
        _callback.reset(token)


def _json_requested() -> bool:
    """True inside a command that was called with --json."""
    context = click.get_current_context(silent=True)
    return context is not None and any(
        "--json" in parameter.opts and bool(context.params.get(parameter.name or ""))
        for parameter in context.command.params
    )
