"""Figures of a page: one style, inline SVG in the colours of the page.

Each figure is drawn twice, for wide screens and for phones, because a shrunken one is illegible.
"""

from __future__ import annotations

import hashlib
import html
import io
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from kinemimic.pipeline.cli.palette import PALETTE, light
from kinemimic.pipeline.files.store import atomic

Draw = Callable[[bool], Figure]  # argument: whether it is for a phone

_STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "text.color": light("ink"),
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": light("axis"),
    "axes.linewidth": 0.8,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": light("rule"),
    "xtick.color": light("axis"),
    "ytick.color": light("axis"),
    "xtick.labelcolor": light("muted"),
    "ytick.labelcolor": light("muted"),
    "axes.labelcolor": light("muted"),
    "legend.frameon": False,
    "lines.linewidth": 1.2,
    "svg.fonttype": "path",
    # A fixed salt gives the same ids, and hence the same bytes, in every run.
    "svg.hashsalt": "kinemimic",
}
# Inches, so that text of 9 points has 12 pixels in a column of 60rem and on a phone.
_PAGE, _PHONE = 9.4, 3.7
_DPI = 200  # of PNG
# Without a date, so that the same figure is the same file.
_SVG_METADATA: dict[str, Any] = {"Date": None, "Creator": None}
_NAMES = {colours[0]: name for name, colours in PALETTE.items()}


def save(draw: Draw, stem: Path) -> None:
    """Write the wide version of a figure as STEM.svg and STEM.png."""
    with mpl.rc_context(_STYLE):
        figure = draw(False)
        for suffix, metadata in ((".svg", _SVG_METADATA), (".png", {"Software": None})):
            with atomic(stem.with_suffix(suffix)) as temporary:
                figure.savefig(temporary, dpi=_DPI, metadata=metadata)


def inline_svg(draw: Draw, phone: bool, alternative: str) -> str:
    """The figure for a page or a phone as an `svg` element of an HTML page.

    Text stays text in the page's font; colours of the palette become its CSS variables. alternative: text for
    readers who cannot see it.
    """
    with mpl.rc_context(_STYLE | {"svg.fonttype": "none", "savefig.transparent": True}):
        stream = io.StringIO()
        draw(phone).savefig(stream, format="svg", metadata=_SVG_METADATA)
    drawn = stream.getvalue()
    (box,) = re.findall(r'<svg [^>]*viewBox="([^"]+)"', drawn)
    # The body, without the document's own style, which would apply to the whole page.
    body = re.sub(
        r"<metadata>.*?</metadata>|<style.*?</style>|<!--.*?-->", "", drawn[drawn.index("<svg") :], flags=re.S
    )
    body = body[body.index(">") + 1 : body.rindex("</svg>")]
    body = re.sub(r"#[0-9a-f]{6}\b", lambda hex_: _variable(hex_.group()), body)
    body = re.sub(r"font-family: [^;\"]*;? ?", "", body)
    label = html.escape(alternative)
    return f'<svg viewBox="{box}" role="img" aria-label="{label}">{_own_ids(body)}</svg>'


def _variable(colour: str) -> str:
    return f"var(--{_NAMES[colour]})" if colour in _NAMES else colour


def _own_ids(body: str) -> str:
    """The drawing with ids that no other drawing of the page has, and only those that it refers to."""
    prefix = "f" + hashlib.sha256(body.encode()).hexdigest()[:8]
    used = set(re.findall(r'(?:href="|url\()#([^")]+)', body))
    body = re.sub(
        r' id="([^"]+)"', lambda found: f' id="{prefix}{found[1]}"' if found[1] in used else "", body
    )
    return re.sub(r'((?:href="|url\()#)', rf"\g<1>{prefix}", re.sub(r"\n\s*", "\n", body))


def panel_grid(
    rows: int, columns: int, height: float, phone: bool, *, width: float = _PAGE, **options: Any
) -> tuple[Figure, list[Axes]]:
    """Axes in reading order; in a single column on a phone.

    height: inches of one panel; width: inches of the figure on a wide page, by default all of its width.
    """
    if phone:
        rows, columns = rows * columns, 1
    figure = Figure(figsize=(_PHONE if phone else width, rows * height + 0.5), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False, **options)
    return figure, list(axes.ravel())


def legend(figure: Figure, axes: Axes) -> None:
    """One legend above the whole figure, with the entries of `axes`."""
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=2 if figure.get_figwidth() < _PAGE else 5)
