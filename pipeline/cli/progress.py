"""Progress bars with rate and remaining time, on stderr of a terminal."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar

import click
from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TaskID, TextColumn, TimeRemainingColumn
from rich.text import Text


class _Rate(ProgressColumn):
    """Units per second; two significant digits below 10."""

    def render(self, task: Task) -> Text:
        speed = task.finished_speed or task.speed
        if speed is None:
            return Text("  -/s")
        return Text(f"{speed:,.0f}/s" if speed >= 10 else f"{speed:.2g}/s")


# Receives the progress of a bar that is drawn elsewhere: its description, the units done so far, and the
# latest numbers shown next to it.
Listener = Callable[[str, float, Mapping[str, object]], object]
_listener: ContextVar[Listener | None] = ContextVar("listener", default=None)


class Bar:
    """A progress bar, with the latest numbers next to it."""

    def __init__(self, drawn: Progress, task: TaskID) -> None:
        self._drawn, self._task = drawn, task

    def advance(self, n: float = 1, **fields: object) -> None:
        """Advance by n units; `fields` (reward=0.83) are shown next to the bar until replaced."""
        if fields:
            note = "  ".join(
                f"{k} {v:.3g}" if isinstance(v, float) else f"{k} {v}" for k, v in fields.items()
            )
            self._drawn.update(self._task, advance=n, note=note)
        else:
            self._drawn.update(self._task, advance=n)

    def remove(self) -> None:
        """Remove the bar from the screen."""
        self._drawn.remove_task(self._task)


class _ForwardedBar(Bar):
    """A bar whose progress goes to a listener."""

    def __init__(self, listener: Listener, description: str) -> None:
        self._listener, self._description, self._done = listener, description, 0.0

    def advance(self, n: float = 1, **fields: object) -> None:
        self._done += n
        self._listener(self._description, self._done, fields)


class Bars:
    """Several bars, one below the other."""

    def __init__(self, drawn: Progress) -> None:
        self._drawn = drawn

    def add(self, description: str, total: float) -> Bar:
        """Add a bar from 0 to `total` units."""
        return Bar(self._drawn, self._drawn.add_task(description, total=total, note=""))

    def say(self, text: str) -> None:
        """Print a line to stderr, above the bars if there are any."""
        self._drawn.console.print(text, markup=False, highlight=False, soft_wrap=True)


@contextmanager
def bars() -> Iterator[Bars]:
    """Several bars; silent if stderr is not a terminal or the command has --json."""
    console = Console(stderr=True)
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:,.0f}/{task.total:,.0f}"),
        _Rate(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[note]}"),
    )
    # Torch workers and subprocesses write to the same terminal; rich must not capture their output.
    with Progress(
        *columns,
        console=console,
        disable=not console.is_terminal or _json_requested(),
        redirect_stdout=False,
        redirect_stderr=False,
    ) as drawn:
        yield Bars(drawn)


@contextmanager
def progress(description: str, total: float) -> Iterator[Bar]:
    """A bar from 0 to `total` units: `with progress("train", budget) as bar: bar.advance(4096, reward=0.8)`.

    Silent if stderr is not a terminal or the command has --json.
    """
    if (listener := _listener.get()) is not None:
        yield _ForwardedBar(listener, description)
        return
    with bars() as several:
        yield several.add(description, total)


@contextmanager
def forwarded_progress(listener: Listener) -> Iterator[None]:
    """Within this block `progress` draws nothing and calls the listener."""
    token = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(token)


def _json_requested() -> bool:
    """True inside a command that was called with --json."""
    context = click.get_current_context(silent=True)
    return context is not None and any(
        "--json" in parameter.opts and bool(context.params.get(parameter.name or ""))
        for parameter in context.command.params
    )
