"""Progress bars on a terminal: one line each, whose time left is never cut off, and a line of notes below."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager

from rich.console import Console, ConsoleOptions, Group, RenderableType
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from kinemimic.pipeline.cli.progress_state import ProgressState

_BAR = 10, 40  # least and greatest width


def drawn(states: Callable[[], Sequence[ProgressState]], console: Console) -> AbstractContextManager[object]:
    """Draw the bars and keep them up to date while the context is open."""
    return Live(
        console=console,
        get_renderable=lambda: Group(*(_Row(state) for state in states())),
        refresh_per_second=4,
        # Torch workers and subprocesses write to the same terminal; rich must not capture their output.
        redirect_stdout=False,
        redirect_stderr=False,
    )


class _Row:
    """A bar with as many facts as the width allows, the most important ones first."""

    def __init__(self, state: ProgressState) -> None:
        self._state = state

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> Iterator[RenderableType]:
        state, width = self._state, options.max_width
        speed = state.per_second
        # Each more dispensable than the one before it.
        facts = [
            state.remaining,
            f"{state.percent:>5}" if state.percent else "",
            state.count,
            "" if speed is None or speed < 1.0 or not state.count else f"{speed:,.0f}/s",
        ]
        name = state.what
        while len(facts) > 1 and _width(name, facts) + _BAR[0] > width:
            facts.pop()
        room = width - _width("", facts) - _BAR[0]
        if len(name) > room:
            name = f"{name[: max(1, room - 1)]}…"
        bar = max(1, min(_BAR[1], width - _width(name, facts)))
        row = Table.grid(padding=(0, 2, 0, 0), pad_edge=False)
        order = [fact for fact in (*facts[1:], facts[0]) if fact]
        row.add_row(
            Text(name, no_wrap=True),
            _bar(state, bar),
            *(Text(fact, no_wrap=True) for fact in order),
        )
        yield row
        if state.notes:
            yield Text(f"  {state.noted}", style="dim")


def _bar(state: ProgressState, width: int) -> ProgressBar:
    """The bar; of a task without a known total, one that pulses."""
    if not math.isfinite(state.total):
        return ProgressBar(total=None, width=width)
    return ProgressBar(total=max(state.total, 1e-9), completed=min(state.done, state.total), width=width)


def _width(name: str, facts: Sequence[str]) -> int:
    """Columns of a row, with two between its cells, apart from the bar."""
    return len(name) + 2 + sum(len(fact) + 2 for fact in facts if fact)
