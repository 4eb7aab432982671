"""`kinemimic gallery`: the rollouts of several runs side by side, as a video and a picture."""

from __future__ import annotations

import json
from pathlib import Path

import click
from PIL import Image

from kinemimic.evaluate.film.film import Scene, scene_of
from kinemimic.evaluate.film.tiles import PANEL, render_tiles
from kinemimic.pipeline.cli.options import json_option
from kinemimic.pipeline.cli.progress import progress
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import atomic
from kinemimic.pipeline.files.video import require_encoder, video
from kinemimic.retarget.formats.motion_json import read_motion_json
from kinemimic.train.rollout.trajectory import Trajectory
from kinemimic.train.sim.world import CONTROL_RATE

AT, SECONDS = 4.0, 10.0  # default time of the picture and length of the video, s
COLUMNS = 4
FILE = click.Path(path_type=Path, dir_okay=False)


def read_scene(run: Path) -> tuple[str, Scene]:
    """Name and rollout from phase 0 of a run that `evaluate` has scored."""
    motion = read_motion_json(run / "motion.json")
    return run.resolve().name, scene_of(Trajectory.load(run / "trajectory.npz", motion), motion)


@click.command("gallery")
@click.argument("runs", nargs=-1, required=True, metavar="RUN...",
                type=click.Path(path_type=Path, file_okay=False))  # fmt: skip
@click.option("--video", "movie", type=FILE, help="Draw a video (.webm).")
@click.option("--picture", type=FILE, help="Draw a picture (.png).")
@click.option("--at", type=click.FloatRange(min=0), default=AT, show_default=True,
              help="Time of the picture, s.")  # fmt: skip
@click.option("--seconds", type=click.FloatRange(min=0.1), default=SECONDS, show_default=True,
              help="Length of the video, s.")  # fmt: skip
@click.option("--columns", type=click.IntRange(1, 16), default=COLUMNS, show_default=True,
              help="Panels in a row.")  # fmt: skip
@json_option("Print the paths as JSON.")
def command(
    runs: tuple[Path, ...],
    movie: Path | None,
    picture: Path | None,
    at: float,
    seconds: float,
    columns: int,
    as_json: bool,
) -> None:
    """Draw the rollouts of RUNs side by side, each with its reference behind it, from phase 0.

    \b
      kinemimic gallery runs/anna runs/bob --video gallery.webm --picture gallery.png
    """
    if movie is None and picture is None:
        raise click.UsageError("expected --video or --picture, found neither")
    if movie is not None:
        require_encoder(movie)
    scenes = []
    for run in runs:
        if not (run / "trajectory.npz").exists():
            raise KinemimicError(f"{run}: expected rollouts, found none; run `kinemimic evaluate` first")
        scenes.append(read_scene(run))
    columns = min(columns, len(scenes))
    rows = -(-len(scenes) // columns)
    if picture is not None:
        (sheet,) = render_tiles(scenes, [round(at * CONTROL_RATE)], columns=columns)
        with atomic(picture) as temporary:
            Image.fromarray(sheet).save(temporary, format="png")
    if movie is not None:
        frames = range(round(seconds * CONTROL_RATE))
        with (
            video(movie, columns * PANEL[0], rows * PANEL[1], CONTROL_RATE) as film,
            progress("video", len(frames)) as bar,
        ):
            for sheet in render_tiles(scenes, frames, columns=columns):
                film.add(sheet[..., ::-1])
                bar.advance()
    made = {"video": movie, "picture": picture}
    if as_json:
        click.echo(json.dumps({name: path and path.as_posix() for name, path in made.items()}))
    else:
        for path in filter(None, made.values()):
            click.echo(path)
