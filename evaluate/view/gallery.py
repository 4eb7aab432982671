"""`kinemimic gallery`: the rollouts of several runs side by side: video, picture, rerun recording."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import click
import rerun as rr
from PIL import Image

from kinemimic.evaluate.film.figures import humanoids
from kinemimic.evaluate.film.film import Scene, scene_of
from kinemimic.evaluate.film.tiles import PANEL, render_tiles
from kinemimic.evaluate.view.layout import gallery_layout
from kinemimic.evaluate.view.png_path import PngPath
from kinemimic.evaluate.view.scene import log_scene
from kinemimic.pipeline.cli.finite_range import FiniteRange
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


def write_gallery(path: Path, runs: Sequence[Path], *, columns: int) -> None:
    """Write the rollouts of runs from phase 0 as one rerun recording, atomically; each has its own view."""
    stream = rr.RecordingStream("kinemimic-gallery", send_properties=False)
    recorded = stream.memory_recording()
    names = [f"{k}-{run.resolve().name}" for k, run in enumerate(runs, start=1)]
    stream.send_blueprint(gallery_layout(names, columns), make_active=False, make_default=True)
    for name, run in zip(names, runs, strict=True):
        motion = read_motion_json(run / "motion.json")
        trajectory = Trajectory.load(run / "trajectory.npz", motion)
        log_scene(stream, name, *humanoids(trajectory, 0, motion.offsets), solid=False)
    with atomic(path) as temporary:
        temporary.write_bytes(recorded.drain_as_bytes())
    stream.disconnect()


@click.command("gallery")
@click.argument("runs", nargs=-1, required=True, metavar="RUN...",
                type=click.Path(path_type=Path, file_okay=False))  # fmt: skip
@click.option("--video", "movie", type=FILE, help="Draw a video (.webm).")
@click.option("--picture", type=PngPath(), help="Draw a picture (.png).")
@click.option("--recording", type=FILE, help="Write a recording for rerun (.rrd).")
@click.option("--at", type=FiniteRange(min=0), default=AT, show_default=True,
              help="Time of the picture, s.")  # fmt: skip
@click.option("--seconds", type=FiniteRange(min=0.1), default=SECONDS, show_default=True,
              help="Maximum length of the video, s.")  # fmt: skip
@click.option("--columns", type=click.IntRange(1, 16), default=COLUMNS, show_default=True,
              help="Panels in a row.")  # fmt: skip
@json_option("Print the paths as JSON.")
def command(
    runs: tuple[Path, ...],
    movie: Path | None,
    picture: Path | None,
    recording: Path | None,
    at: float,
    seconds: float,
    columns: int,
    as_json: bool,
) -> None:
    """Draw the rollouts of RUNs side by side, each with its reference behind it, from phase 0.

    \b
      kinemimic gallery runs/anna runs/bob --video gallery.webm --picture gallery.png
    """
    if movie is None and picture is None and recording is None:
        raise click.UsageError("expected --video, --picture or --recording, found none")
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
        longest = max(len(scene.figure.positions) for _, scene in scenes)
        frames = range(min(longest, max(1, round(seconds * CONTROL_RATE))))
        with (
            video(movie, columns * PANEL[0], rows * PANEL[1], CONTROL_RATE) as film,
            progress("video", len(frames)) as bar,
        ):
            for sheet in render_tiles(scenes, frames, columns=columns):
                film.add(sheet[..., ::-1])
                bar.advance()
    if recording is not None:
        write_gallery(recording, runs, columns=columns)
    made = {"video": movie, "picture": picture, "recording": recording}
    if as_json:
        click.echo(json.dumps({name: path and path.as_posix() for name, path in made.items()}))
    else:
        for path in filter(None, made.values()):
            click.echo(path)
