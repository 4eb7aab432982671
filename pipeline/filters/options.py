"""Options of `ingest`, which `run` passes on; free of heavy imports so that --help is fast."""

from __future__ import annotations

import click

from kinemimic.pipeline.cli.options import option_group, rate_option, unit_option, video_options

# The first is the default: `make bench-clean` finds it closest to the truth.
FILTERS: tuple[str, ...] = ("kalman", "butterworth", "one-euro", "none")

ingest_options = option_group(
    click.option(
        "--filter",
        "filter_name",
        type=click.Choice(FILTERS),
        help="Noise filter. Default: the Kalman smoother.",
    ),
    unit_option("Length unit of the file. Default: as declared by the format, or inferred from body size."),
    rate_option("True frame rate of the file in Hz. Default: from the file's clock."),
    *video_options,
)
