"""Tables, headings and numbers of reports in a terminal."""

from __future__ import annotations

import os

from rich.console import Console, RenderableType
from rich.table import Table
from rich.text import Text

# Characters, if stdout is not a terminal.
WIDTH = 100


def show(*parts: RenderableType) -> None:
    """Print to stdout; text wraps at the width of the terminal."""
    console = Console(highlight=False, markup=False)
    if not console.is_terminal and "COLUMNS" not in os.environ:
        console = Console(highlight=False, markup=False, width=WIDTH)
    for part in parts:
        console.print(part, crop=False)


def grid(*columns: str, left: int = 1, gap: int = 2) -> Table:
    """A table with headings, `gap` spaces apart; the first `left` columns are text, the others numbers."""
    table = Table(box=None, pad_edge=False, padding=(0, gap, 0, 0), header_style="bold")
    for index, column in enumerate(columns):
        words = index < left
        table.add_column(column, justify="left" if words else "right", overflow="fold", no_wrap=not words)
    return table


def key_value_table() -> Table:
    """A table of two columns, name and value; long values wrap in their column."""
    table = Table.grid(padding=(0, 2, 0, 0))
    table.add_column(style="bold", no_wrap=True)
    table.add_column(overflow="fold")
    return table


def heading(text: str) -> Text:
    """Heading of a section."""
    return Text(f"\n{text}", style="bold")


def number(value: float | None, digits: int, unit: str = "") -> str:
    """A number with `digits` decimals and its unit, or a dash for None."""
    return "-" if value is None else f"{value:.{digits}f}{unit}"


def percent(share: float | None) -> str:
    """A share in per cent with one decimal, or a dash for None."""
    return number(None if share is None else 100.0 * share, 1)
