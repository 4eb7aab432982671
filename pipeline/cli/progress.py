"""Progress bars with rate and time left, on stderr, for a person at a terminal."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar

import click
from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TaskID, TextColumn, TimeRemainingColumn
from rich.text import Text


class _Rate(ProgressColumn):
    """Units per second, with as many digits as it takes to see it change."""

    def render(self, task: Task) -> Text:
        speed = task.finished_speed or task.speed
        if speed is None:
            return Text("  -/s")
        return Text(f"{speed:,.0f}/s" if speed >= 10 else f"{speed:.2g}/s")


# What another process of ours, which draws nothing, is told of a bar: its description, the units done so far,
# and the newest numbers beside it.
Listener = Callable[[str, float, Mapping[str, object]], object]
_listener: ContextVar[Listener | None] = ContextVar("listener", default=None)


class Bar:
    """What `progress` hands out: count forward, and show the newest numbers beside the bar."""

    def __init__(self, drawn: Progress, task: TaskID) -> None:
        self._drawn, self._task = drawn, task

    def advance(self, n: float = 1, **fields: object) -> None:
        """Count n units further; `fields` (reward=0.83) stand beside it until replaced."""
        if fields:
            note = "  ".join(
                f"{k} {v:.3g}" if isinstance(v, float) else f"{k} {v}" for k, v in fields.items()
            )
            self._drawn.update(self._task, advance=n, note=note)
        else:
            self._drawn.update(self._task, advance=n)

    def remove(self) -> None:
        """Take it off the screen."""
        self._drawn.remove_task(self._task)


class _ForwardedBar(Bar):
    """A bar that is drawn elsewhere."""

    def __init__(self, listener: Listener, description: str) -> None:
        self._listener, self._description, self._done = listener, description, 0.0

    def advance(self, n: float = 1, **fields: object) -> None:
        self._done += n
        self._listener(self._description, self._done, fields)


class Bars:
    """Several bars below each other."""

    def __init__(self, drawn: Progress) -> None:
        self._drawn = drawn

    def add(self, description: str, total: float) -> Bar:
        """One more, from 0 to `total` units."""
        return Bar(self._drawn, self._drawn.add_task(description, total=total, note=""))

    def say(self, text: str) -> None:
        """A line that stays, above the bars; to stderr, whether bars are drawn or not."""
        self._drawn.console.print(text, markup=False, highlight=False, soft_wrap=True)


@contextmanager
def bars() -> Iterator[Bars]:
    """Several bars. Silent when stderr is no terminal and under a command's --json."""
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

    Silent when stderr is no terminal and under a command's --json.
    """
    if (listener := _listener.get()) is not None:
        yield _ForwardedBar(listener, description)
        return
    with bars() as several:
        yield several.add(description, total)


@contextmanager
def forwarded_progress(listener: Listener) -> Iterator[None]:
    """In here `progress` draws nothing and tells the listener."""
    token = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(token)


def _json_requested() -> bool:
    """True inside a command that was called with --json, whatever its parameter is called in Python."""
    context = click.get_current_context(silent=True)
    return context is not None and any(
        "--json" in parameter.opts and bool(context.params.get(parameter.name or ""))
        for parameter in context.command.params
    )
