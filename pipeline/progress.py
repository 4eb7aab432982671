"""A progress bar with rate and time left, on stderr, for a person at a terminal."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

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


class Bar:
    """What `progress` hands out: count forward, and show the newest numbers beside the bar."""

    def __init__(self, bars: Progress, task: TaskID) -> None:
        self._bars, self._task = bars, task

    def advance(self, n: float = 1, **fields: object) -> None:
        """Count n units further; `fields` (reward=0.83) stand beside it until replaced."""
        if fields:
            note = "  ".join(
                f"{k} {v:.3g}" if isinstance(v, float) else f"{k} {v}" for k, v in fields.items()
            )
            self._bars.update(self._task, advance=n, note=note)
        else:
            self._bars.update(self._task, advance=n)


@contextmanager
def progress(description: str, total: float) -> Iterator[Bar]:
    """A bar from 0 to `total` units: `with progress("train", budget) as bar: bar.advance(4096, reward=0.8)`.

    Silent when stderr is no terminal and under a command's --json.
    """
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
    ) as bars:
        yield Bar(bars, bars.add_task(description, total=total, note=""))


def _json_requested() -> bool:
    """True inside a command that was called with --json, whatever its parameter is called in Python."""
    context = click.get_current_context(silent=True)
    return context is not None and any(
        "--json" in parameter.opts and bool(context.params.get(parameter.name or ""))
        for parameter in context.command.params
    )
