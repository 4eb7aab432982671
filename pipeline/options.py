"""The option that the commands of a run have in common: its folder."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

DEFAULT_RUN = Path("runs/default")
# As in captures/units.py, which is not loaded for --help.
UNITS = ("m", "cmu", "inch", "cm", "mm")


def run_option(name: str = "run") -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """--run, a path, handed to the command's function as `name`."""
    return click.option(
        "--run",
        name,
        type=click.Path(path_type=Path),
        default=DEFAULT_RUN,
        show_default=True,
        help="The run folder.",
    )


def unit_option(text: str) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """--unit, a length unit by its short name or None."""
    return click.option("--unit", type=click.Choice(UNITS), help=text)
