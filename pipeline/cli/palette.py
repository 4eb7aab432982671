"""The colours of pages and figures, each for a light and a dark background.

Figures are drawn in the light colours. In a page, each of these becomes a CSS variable of its name, so that
one drawing serves light, dark and print. A colour that is not in the palette stays as it is.
"""

from __future__ import annotations

from collections.abc import Mapping

# Colours of curves are colour-blind safe (Okabe and Ito) and distinct in greyscale print.
PALETTE: Mapping[str, tuple[str, str]] = {
    "page": ("#ffffff", "#14171a"),
    "ink": ("#2b2b2b", "#e7e6e3"),
    "muted": ("#5c5c5c", "#a9aba8"),
    "rule": ("#e6e6e6", "#2e3338"),
    "axis": ("#9a9a9a", "#6d7276"),
    "band": ("#dadada", "#3a4046"),  # norms, limits: what a curve is compared with
    "fallen": ("#f0f0f0", "#202428"),  # behind curves, after a fall
    "ghost": ("#ababab", "#70757a"),  # curves after a fall
    "blue": ("#0072b2", "#4fb0ec"),
    "orange": ("#d98c00", "#f0b34a"),
    "green": ("#009e73", "#3ecb9d"),
    "pink": ("#cc79a7", "#e6a0c6"),
    "purple": ("#7a5c9e", "#b79be0"),
    "sky": ("#56b4e9", "#9bd4f7"),
    "red": ("#d55e00", "#ff8f4d"),
    "sand": ("#b9a48f", "#8f7f6f"),
    "good": ("#17703f", "#57c98a"),
    "good-tint": ("#e6f4ec", "#14301f"),
    "partial": ("#946200", "#edb54c"),
    "partial-tint": ("#fff4da", "#33280f"),
    "bad": ("#b3261e", "#ff8a80"),
    "bad-tint": ("#fdeae8", "#3a1a18"),
}


def light(name: str) -> str:
    """The colour to draw with."""
    return PALETTE[name][0]
