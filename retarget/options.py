"""Options of `retarget`, which `run` passes on; free of heavy imports so that --help is fast."""

from __future__ import annotations

import click

from kinemimic.pipeline.cli.options import option_group
from kinemimic.retarget.feet.ankles import ANKLE_MODES

retarget_options = option_group(
    click.option(
        "--symmetric/--as-recorded",
        default=None,
        help="Average the left and right sides, or keep their difference. Default: decided by measurement.",
    ),
    click.option(
        "--refine/--no-refine",
        "refined",
        default=True,
        show_default=True,
        help="Optimise all frames together for foot contact, ground and joint limits.",
    ),
    click.option(
        "--ankle",
        type=click.Choice(ANKLE_MODES),
        default="neutral",
        show_default=True,
        help="Ankles of a walk whose feet the sensor did not see: flat in stance, or as in normal walking.",
    ),
    click.option(
        "--loop/--no-loop",
        default=None,
        help="Average all strides into a loop, or keep the longest walk. Default: a loop for a gait.",
    ),
    click.option(
        "--straighten/--no-straighten",
        default=None,
        help="Straighten a walk on a curve, or keep its turns, as recorded. Default: straight for a loop.",
    ),
    click.option(
        "--segment",
        metavar="NAME|START-END",
        help="Segment of the capture: a name that `inspect` lists, or a time range in seconds, such as "
        "3.5-12. Default: all usable walks like the longest; without a walk, the longest pass.",
    ),
    click.option(
        "--balance/--no-balance",
        default=None,
        help="Displace the root of a walk from a depth sensor or a video to bring its zero-moment point "
        "nearer to the soles, or turn and displace a body on the spot to bring it over the middle of its "
        "feet. Running is never changed. Default: only for a tracker.",
    ),
)
