"""Figures of a page: one style, embedded as SVG.

Each figure is drawn twice, for wide screens and for phones, because a shrunken one is illegible.
"""

from __future__ import annotations

import base64
import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from kinemimic.pipeline.files.store import atomic

Draw = Callable[[bool], Figure]  # argument: whether it is for a phone

# A fixed salt gives the same ids, and hence the same bytes, in every run.
_STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#9a9a9a",
    "axes.linewidth": 0.8,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#ececec",
    "xtick.color": "#555555",
    "ytick.color": "#555555",
    "axes.labelcolor": "#333333",
    "legend.frameon": False,
    "lines.linewidth": 1.2,
    "svg.fonttype": "path",
    "svg.hashsalt": "kinemimic",
}
_PAGE, _PHONE = 8.6, 4.3  # inches
_DPI = 200  # of PNG
# Without a date, so that the same figure is the same file.
_SVG_METADATA: dict[str, Any] = {"Date": None, "Creator": None}


def save(draw: Draw, stem: Path) -> None:
    """Write the wide version of a figure as STEM.svg and STEM.png."""
    with mpl.rc_context(_STYLE):
        figure = draw(False)
        for suffix, metadata in ((".svg", _SVG_METADATA), (".png", {"Software": None})):
            with atomic(stem.with_suffix(suffix)) as temporary:
                figure.savefig(temporary, dpi=_DPI, metadata=metadata)


def data_uri(draw: Draw, phone: bool) -> str:
    """The figure for a page or a phone as SVG in a data URI."""
    with mpl.rc_context(_STYLE):
        figure = draw(phone)
        stream = io.BytesIO()
        figure.savefig(stream, format="svg", metadata=_SVG_METADATA)
    return "data:image/svg+xml;base64," + base64.b64encode(stream.getvalue()).decode()


def panel_grid(
    rows: int, columns: int, height: float, phone: bool, **options: Any
) -> tuple[Figure, list[Axes]]:
    """Axes in reading order; in a single column on a phone. height: inches of one panel."""
    if phone:
        rows, columns = rows * columns, 1
    figure = Figure(figsize=(_PHONE if phone else _PAGE, rows * height + 0.5), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False, **options)
    return figure, list(axes.ravel())


def legend(figure: Figure, axes: Axes) -> None:
    """One legend above the whole figure, with the entries of `axes`."""
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=2 if figure.get_figwidth() < _PAGE else 5)
