"""Options that several commands have: which engine simulates, in how many processes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import click

from kinemimic.train.sim.engines import ENGINES

Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]

engine_option: Decorator = click.option(
    "--engine",
    type=click.Choice(ENGINES),
    default="auto",
    show_default=True,
    help="Native where it is built.",
)
workers_option: Decorator = click.option(
    "--workers", type=click.IntRange(min=1), help="Processes that simulate; all cores by default."
)
