"""The option that the commands of a run have in common: its folder."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

DEFAULT_RUN = Path("runs/default")


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
