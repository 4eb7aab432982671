"""`kinemimic datasets record`: a virtual Kinect's recordings as files."""

from __future__ import annotations

import json
from pathlib import Path

import click

from kinemimic.pipeline.cli.options import json_option
from kinemimic.pipeline.virtual_kinect.recorder import record_virtual


@click.command("record")
@click.argument("motions", nargs=-1, required=True, type=click.Choice(["walk", "run"]), metavar="walk|run...")
@click.option(
    "--into", type=click.Path(path_type=Path, file_okay=False), required=True, help="Output folder."
)
@click.option(
    "--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Seed of noise and passes."
)
@json_option("Print the paths as JSON.")
def command(motions: tuple[str, ...], into: Path, seed: int, as_json: bool) -> None:
    """Record a real person's walk or run with a virtual Kinect, as .skl and as BVH with Euler angles.

    Each file comes with its true joint angles and a note of its origin. Recordings are marked as simulated.

    \b
      kinemimic datasets record walk --into recordings
    """
    paths = [str(path) for motion in motions for path in record_virtual(into, motion=motion, seed=seed)]
    click.echo(json.dumps({"paths": paths}, indent=2) if as_json else "\n".join(paths))
