"""Options of the commands that simulate: the engine and the number of processes."""

from __future__ import annotations

import click

from kinemimic.pipeline.cli.options import Decorator
from kinemimic.train.sim.engines import ENGINES

engine_option: Decorator = click.option(
    "--engine",
    type=click.Choice(ENGINES),
    default="auto",
    show_default=True,
    help="Simulation engine; auto: native if it is built, else pybullet.",
)
workers_option: Decorator = click.option(
    "--workers", type=click.IntRange(min=1), help="Number of simulation processes. Default: one per core."
)
