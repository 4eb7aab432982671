"""Options of `train`, which `run` passes on; free of heavy imports so that --help is fast."""

from __future__ import annotations

import click

from kinemimic.pipeline.cli.options import option_group, seed_option
from kinemimic.train.config.budget import MINUTES, samples
from kinemimic.train.config.from_tracker import OBSTACLES
from kinemimic.train.config.presets import PRESETS
from kinemimic.train.sim.options import engine_option

training_options = option_group(
    click.option(
        "--preset",
        "preset_name",
        type=click.Choice([*PRESETS, OBSTACLES]),
        default="default",
        help="Named set of training settings. Default: `default`; in `run`, training on a walk or run starts "
        "from the shipped tracker unless a preset is given.",
    ),
    click.option(
        "--from",
        "start",
        metavar="POLICY",
        help="Start from a trained policy: `tracker` for a walk or run, `standing` for a motion without "
        "strides, `robust_walk` with --preset obstacles, or a run folder. The settings are then its own; "
        "--preset robust adds pushes, --preset obstacles adds obstacles.",
    ),
    click.option(
        "--teachers",
        type=click.Path(file_okay=False),
        help="With --preset obstacles: folder of policies that were trained among obstacles on this motion.",
    ),
    click.option(
        "--budget",
        type=samples,
        help="Samples (control steps) in total, such as 1M or 300k. Default: the preset's; with --from "
        "tracker 280k or fewer, and up to 1M if the humanoid does not walk by then, or with --preset robust "
        "4.75M; with --from standing 500k. Not with --preset obstacles.",
    ),
    click.option(
        "--minutes",
        type=MINUTES,
        help="Stop after this training time, even if the budget is not used up. Not with --preset obstacles.",
    ),
    seed_option(),
    engine_option,
    click.option(
        "--anyway", is_flag=True, help="Train even if the check before training refuses the motion."
    ),
)
