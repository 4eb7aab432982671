"""Tables, headings and numbers of reports in a terminal."""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import Any

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from kinemimic.pipeline.cli.printable import printable

# Characters, if stdout is not a terminal.
WIDTH = 100


class PrintableConsole(Console):
    """A console that prints control characters of texts as their numbers; style is applied afterwards."""

    def render_str(self, text: str, **options: Any) -> Text:
        """A string as Text; before the columns of a table get their widths."""
        return super().render_str(printable(text), **options)

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """The segments of any renderable, texts and cells of tables included."""
        for segment in super().render(renderable, options):
            yield segment if segment.control else Segment(printable(segment.text), segment.style)


def show(*parts: RenderableType, wrap: bool = True) -> None:
    """Print to stdout; text wraps at the width of the terminal.

    wrap: False for reports with paths, which cannot be opened if they are broken over two lines.
    """
    console = PrintableConsole(highlight=False, markup=False)
    if wrap and not console.is_terminal and "COLUMNS" not in os.environ:
        console = PrintableConsole(highlight=False, markup=False, width=WIDTH)
    for part in parts:
        console.print(part, crop=False, soft_wrap=not wrap)


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
