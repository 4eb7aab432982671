"""`kinemimic view`: playback, motion, scores and capture of a run in, a rerun recording out."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

import click
import rerun as rr

from kinemimic.evaluate.policies.shipped import evaluated, run_options
from kinemimic.evaluate.view.caption import caption, caption_of_trial
from kinemimic.evaluate.view.captured_skeleton import Captured, captured, log_captured
from kinemimic.evaluate.view.layout import layout
from kinemimic.evaluate.view.obstacle_rendering import Props, log_contacts, log_props
from kinemimic.evaluate.view.scenario_replay import staged
from kinemimic.evaluate.view.scene import (
    CAPTURED,
    REFERENCE,
    SIMULATED,
    TIMELINE,
    Figure,
    clock,
    figures,
    log_curves,
    log_scenes,
    set_apart,
)
from kinemimic.pipeline.cli.options import json_option
from kinemimic.pipeline.files.store import atomic, content_hash, read_json
from kinemimic.retarget.formats.motion_json import read_motion_json
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.rollout.policy import learnt
from kinemimic.train.rollout.trajectory import Trajectory
from kinemimic.train.scenario.scenario import Scenario
from kinemimic.train.scenario.scenario_file import scenario as read
from kinemimic.train.sim.world import CONTROL_RATE

ROLLOUT = 0  # the one that began at the start of the reference
AT, SECONDS = 4.0, 10.0  # s: of the screenshot, of the video at most
FILE = click.Path(path_type=Path, dir_okay=False)


def view(run: Path) -> Path:
    """Write view.rrd into the run folder and return its path.

    Reads motion.json and trajectory.npz, and if they are there scores.json, and raw.parquet with
    capture.parquet: the capture. The file brings its own layout; nothing is served or sent.
    """
    motion = read_motion_json(run / "motion.json")
    trajectory = Trajectory.load(run / "trajectory.npz")
    scores = read_json(run / "scores.json") if (run / "scores.json").exists() else None
    pair, phases = figures(trajectory, ROLLOUT, motion.offsets), trajectory.phases[ROLLOUT]
    shown = captured(run, phases, clock(len(phases)), pair[0], cyclic=motion.cyclic)
    told = caption(motion, trajectory, ROLLOUT, scores, None if shown is None else shown.told())
    path = run / "view.rrd"
    write_recording(path, trajectory, pair, told, shown=shown)
    return path


def view_trial(
    run: Path, scenario: Scenario, *, number: int = 0, seed: int = 0, engine: str = "auto"
) -> Path:
    """Let the run's policy do a trial of a scenario, write view-NAME.rrd and return its path.

    number, seed: which of those that `disturb` makes; engine: of `train/engines.py`.
    """
    motion, policy, record = learnt(run)
    config = TrainConfig.from_json(record["config"])
    trajectory, props = staged(motion, policy, config, scenario, number=number, seed=seed, engine=engine)
    told = caption_of_trial(motion, trajectory, scenario, number)
    path = run / f"view-{scenario.name}.rrd"
    write_recording(path, trajectory, figures(trajectory, ROLLOUT, motion.offsets), told, props=props)
    return path


def write_recording(
    path: Path,
    trajectory: Trajectory,
    pair: tuple[Figure, Figure],
    told: str,
    *,
    props: Props | None = None,
    shown: Captured | None = None,
) -> None:
    """A playback's first rollout as a rerun recording, atomically.

    pair: its `figures`; told: Markdown beside them.
    """
    # A viewer merges recordings of one id: it has to differ between runs, and only between runs.
    identity = content_hash({"root": trajectory.root[ROLLOUT], "rotations": trajectory.rotations[ROLLOUT]})[
        :32
    ]
    stream = rr.RecordingStream("kinemimic", recording_id=identity, send_properties=False)
    # Into memory: rerun's own file sink logs that the disk is full, and goes on.
    recorded = stream.memory_recording()
    stream.send_blueprint(layout(capture=shown is not None), make_active=False, make_default=True)
    log_scenes(stream, *pair)
    log_contacts(stream, pair[1], trajectory.contact_forces[ROLLOUT])
    if props is not None:
        log_props(stream, pair[1], props)
    if shown is not None:
        log_captured(stream, shown)
    set_apart(stream, (SIMULATED, REFERENCE) if shown is None else (SIMULATED, REFERENCE, CAPTURED))
    log_curves(stream, trajectory, ROLLOUT)
    stream.log("scores", rr.TextDocument(told, media_type=rr.MediaType.MARKDOWN), static=True)
    with atomic(path) as temporary:
        temporary.write_bytes(recorded.drain_as_bytes())
    stream.disconnect()


def how_to_open(recording: Path) -> str:
    """The command that opens a recording: the viewer of this environment where it is not on the path."""
    viewer = "rerun" if shutil.which("rerun") else str(Path(sys.executable).with_name("rerun"))
    return f"open it with: {viewer} {recording}"


def _evaluate_if_needed(run: Path) -> None:
    if not evaluated(run):
        from kinemimic.evaluate.scoring.command import evaluate  # noqa: PLC0415 (--help must not load it)

        evaluate(run)


@click.command("view")
@run_options(then=_evaluate_if_needed)
@click.option("--screenshot", "picture", type=FILE, help="Also draw the recording as PNG (*).")
@click.option("--at", type=click.FloatRange(min=0), help=f"The screenshot's time, s; {AT:g} unless said.")
@click.option("--video", "movie", type=FILE, help="Also film the recording, as .mp4 or .avi (*).")
@click.option(
    "--seconds", type=click.FloatRange(min=0.1), help=f"Of the video, at most; {SECONDS:g} unless said."
)
@click.option("--scenario", "named", metavar="NAME", help="A trial of it into view-NAME.rrd.")
@click.option("--trial", "number", type=click.IntRange(min=0), default=0, show_default=True, help="Which.")
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Of the trials.")
@json_option("Print the paths as JSON.")
def command(
    run: Path,
    picture: Path | None,
    at: float | None,
    movie: Path | None,
    seconds: float | None,
    named: str | None,
    number: int,
    seed: int,
    as_json: bool,
) -> None:
    """Reference, simulated figure and capture, curves and scores, as a rerun recording.

    A policy that ships performs first, where it has not yet. Green arrows: what the ground and obstacles push
    with, 1000 N to a metre. With --scenario: what `disturb` counts, with obstacles and forces (red arrows,
    100 N to a metre). White joints: the capture as it was read, pink where the sensor guessed.

    (*) Needs no screen, but a Vulkan driver.

    \b
      kinemimic view --run runs/walk
      kinemimic view --policy walk --scenario room --trial 3
    """
    if named is None and (number or seed):
        raise click.UsageError("--trial and --seed are of a --scenario")
    if (picture is None and at is not None) or (movie is None and seconds is not None):
        raise click.UsageError("--at is of a --screenshot, --seconds are of a --video")
    recording = view(run) if named is None else view_trial(run, read(named), number=number, seed=seed)
    # The viewer's client and OpenCV are loaded for these only.
    if picture is not None:
        from kinemimic.evaluate.view.screenshot import screenshot  # noqa: PLC0415

        screenshot(recording, picture, timeline=TIMELINE, seconds=AT if at is None else at)
    if movie is not None:
        from kinemimic.evaluate.view.film import film  # noqa: PLC0415

        film(
            recording,
            movie,
            timeline=TIMELINE,
            rate=CONTROL_RATE,
            seconds=SECONDS if seconds is None else seconds,
        )
    made = {"recording": recording, "screenshot": picture, "video": movie}
    if as_json:
        click.echo(json.dumps({name: path and path.as_posix() for name, path in made.items()}))
    else:
        click.echo(f"{recording} ({how_to_open(recording)})")
        for path in filter(None, (picture, movie)):
            click.echo(str(path))
