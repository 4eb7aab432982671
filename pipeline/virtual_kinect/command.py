"""`kinemimic datasets record`: a virtual Kinect's recordings as files."""

from __future__ import annotations

import json
from pathlib import Path

import click

from kinemimic.pipeline.cli.finite_range import FiniteRange
from kinemimic.pipeline.cli.options import json_option, seed_option
from kinemimic.pipeline.virtual_kinect.placement import PLACEMENTS
from kinemimic.pipeline.virtual_kinect.recorder import record_virtual
from kinemimic.pipeline.virtual_kinect.walker import SPEEDS


@click.command("record")
@click.argument("motions", nargs=-1, required=True, type=click.Choice(["walk", "run"]), metavar="walk|run...")
@click.option(
    "--into", type=click.Path(path_type=Path, file_okay=False), required=True, help="Output folder."
)
@seed_option("Seed of the person, the strides, the passes and the noise.")
@click.option(
    "--speed",
    type=FiniteRange(min(low for low, _ in SPEEDS.values()), max(high for _, high in SPEEDS.values())),
    help="m/s: 0.6 to 1.8 for a walk, 2.5 to 4.5 for a run.",
)
@click.option(
    "--variability",
    type=FiniteRange(0.0, 2.0),
    default=1.0,
    show_default=True,
    help="Variation of the strides as a multiple of what was measured on people; 0: one exact cycle.",
)
@click.option(
    "--sensor",
    type=click.Choice(list(PLACEMENTS)),
    default="fixed",
    show_default=True,
    help="The sensor: level, with a wrong floor plane, without a floor plane, or turning with the walker.",
)
@json_option("Print the paths as JSON.")
def command(
    motions: tuple[str, ...],
    into: Path,
    seed: int,
    speed: float | None,
    variability: float,
    sensor: str,
    as_json: bool,
) -> None:
    """Record a person's walk or run with a virtual Kinect, as .skl and as BVH with Euler angles.

    The motion is a real person's walk or run, with strides that vary as people's do. Each file comes with
    its true joint angles and a note of its origin. Recordings are marked as simulated.

    \b
      kinemimic datasets record walk --into recordings
      kinemimic datasets record walk --into recordings --speed 1.4 --sensor turning
    """
    for motion in motions:
        low, high = SPEEDS[motion]
        if speed is not None and not low <= speed <= high:
            raise click.BadParameter(
                f"expected {low} to {high} m/s for a {motion}, found {speed}", param_hint="'--speed'"
            )
    paths = [
        str(path)
        for motion in motions
        for path in record_virtual(
            into, motion=motion, seed=seed, speed=speed, variability=variability, sensor=sensor
        )
    ]
    click.echo(json.dumps({"paths": paths}, indent=2) if as_json else "\n".join(paths))
