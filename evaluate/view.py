"""`kinemimic view`: playback.npz, motion.json and scores.json in, a rerun recording out."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

import click
import rerun as rr

from kinemimic.evaluate.caption import caption, caption_of_trial
from kinemimic.evaluate.layout import layout
from kinemimic.evaluate.scene import TIMELINE, Props, figures, log_curves, log_props, log_scenes
from kinemimic.evaluate.shipped import run_options
from kinemimic.evaluate.staged import staged
from kinemimic.pipeline.store import atomic, content_hash, read_json
from kinemimic.retarget.export_json import motion_from_json
from kinemimic.retarget.motion import Motion
from kinemimic.train.config import TrainConfig
from kinemimic.train.playback import Playback
from kinemimic.train.policy import learnt
from kinemimic.train.scenario import Scenario
from kinemimic.train.scenario_file import scenario as read

ROLLOUT = 0  # the one that began at the start of the reference


def view(run: Path) -> Path:
    """Write view.rrd into the run folder and return its path.

    Reads motion.json and playback.npz, and scores.json if it is there. The file brings its own layout;
    nothing is served or sent.
    """
    motion = motion_from_json(run / "motion.json")
    playback = Playback.load(run / "playback.npz")
    scores = read_json(run / "scores.json") if (run / "scores.json").exists() else None
    return _write(run / "view.rrd", motion, playback, caption(motion, playback, ROLLOUT, scores))


def view_trial(
    run: Path, scenario: Scenario, *, number: int = 0, seed: int = 0, engine: str = "auto"
) -> Path:
    """Let the run's policy do a trial of a scenario, write view-NAME.rrd and return its path.

    number, seed: which of those that `disturb` makes; engine: of `train/engines.py`.
    """
    motion, policy, record = learnt(run)
    config = TrainConfig.from_json(record["config"])
    playback, props = staged(motion, policy, config, scenario, number=number, seed=seed, engine=engine)
    told = caption_of_trial(motion, playback, scenario, number)
    return _write(run / f"view-{scenario.name}.rrd", motion, playback, told, props)


def _write(path: Path, motion: Motion, playback: Playback, told: str, props: Props | None = None) -> Path:
    # A viewer merges recordings of one id: it has to differ between runs, and only between runs.
    identity = content_hash({"root": playback.root[ROLLOUT], "rotations": playback.rotations[ROLLOUT]})[:32]
    stream = rr.RecordingStream("kinemimic", recording_id=identity, send_properties=False)
    with atomic(path) as temporary:
        stream.save(temporary, default_blueprint=layout())
        log_scenes(stream, *figures(playback, ROLLOUT, motion.offsets))
        if props is not None:
            log_props(stream, props)
        log_curves(stream, playback, ROLLOUT)
        text = rr.TextDocument(told, media_type=rr.MediaType.MARKDOWN)
        stream.log("scores", text, static=True)
        stream.disconnect()
    return path


def how_to_open(recording: Path) -> str:
    """The command that opens a recording: the viewer of this environment where it is not on the path."""
    viewer = "rerun" if shutil.which("rerun") else str(Path(sys.executable).with_name("rerun"))
    return f"open it with: {viewer} {recording}"


@click.command("view")
@run_options(performed=True)
@click.option(
    "--screenshot",
    "picture",
    type=click.Path(path_type=Path, dir_okay=False),
    help="Also draw the recording as PNG; needs no screen, but a Vulkan driver.",
)
@click.option(
    "--at", "seconds", type=click.FloatRange(min=0), default=4.0, show_default=True, help="Its time, s."
)
@click.option("--scenario", "named", metavar="NAME", help="A trial of it into view-NAME.rrd.")
@click.option("--trial", "number", type=click.IntRange(min=0), default=0, show_default=True, help="Which.")
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Of the trials.")
@click.option("--json", "as_json", is_flag=True, help="Print the paths as JSON.")
def command(
    run: Path, picture: Path | None, seconds: float, named: str | None, number: int, seed: int, as_json: bool
) -> None:
    """Reference against simulated figure, curves and scores, as a rerun recording.

    A policy that ships performs first, where it has not yet. With --scenario: what `disturb` counts, with
    obstacles, loads (red, 100 N to a metre) and contact forces (green, 1000 N to a metre).
    """
    if named is None and (number or seed):
        raise click.UsageError("--trial and --seed are of a --scenario")
    recording = view(run) if named is None else view_trial(run, read(named), number=number, seed=seed)
    if picture is not None:
        # The viewer's client is loaded for this only.
        from kinemimic.evaluate.screenshot import screenshot  # noqa: PLC0415

        screenshot(recording, picture, timeline=TIMELINE, seconds=seconds)
    if as_json:
        paths = {"recording": recording.as_posix(), "screenshot": picture.as_posix() if picture else None}
        click.echo(json.dumps(paths))
    else:
        click.echo(f"{recording} ({how_to_open(recording)})")
        if picture is not None:
            click.echo(str(picture))
