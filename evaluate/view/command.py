"""`kinemimic view`: trajectory, motion, scores and capture of a run as a rerun recording."""

from __future__ import annotations

import json
import re
import shlex
import shutil
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import rerun as rr

from kinemimic.evaluate.film.camera import CAMERAS
from kinemimic.evaluate.film.figures import CAPTURED, REFERENCE, SIMULATED, Humanoid, humanoids
from kinemimic.evaluate.film.film import SIZE, SIZES, Scene, scene_of
from kinemimic.evaluate.film.looks import LOOKS
from kinemimic.evaluate.film.movie import write_movie
from kinemimic.evaluate.policies.scores_file import read_scores
from kinemimic.evaluate.policies.shipped import evaluated, run_options
from kinemimic.evaluate.policies.unfinished import say, unfinished_policy, unfinished_rollouts
from kinemimic.evaluate.scoring.reports.index_page import write_index
from kinemimic.evaluate.view.caption import caption, trial_caption
from kinemimic.evaluate.view.captured_skeleton import CapturedSkeleton, captured_skeleton, log_skeleton
from kinemimic.evaluate.view.layout import layout
from kinemimic.evaluate.view.obstacle_rendering import (
    Disturbances,
    disturbance_solids,
    log_contacts,
    log_disturbances,
)
from kinemimic.evaluate.view.png_path import PngPath
from kinemimic.evaluate.view.scenario_replay import replay_scenario
from kinemimic.evaluate.view.scene import (
    TIMELINE,
    frame_times,
    log_curves,
    log_scenes,
    place_side_by_side,
)
from kinemimic.pipeline.cli.finite_range import FiniteRange
from kinemimic.pipeline.cli.options import json_option, seed_option
from kinemimic.pipeline.cli.printable import echo
from kinemimic.pipeline.files.store import atomic, content_hash
from kinemimic.pipeline.files.video import require_encoder
from kinemimic.pipeline.run_folder.stage import stage
from kinemimic.retarget.formats.motion_json import read_motion_json
from kinemimic.retarget.formats.same_motion import require_same_motion
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.rollout.policy import load_trained
from kinemimic.train.rollout.trajectory import Trajectory
from kinemimic.train.scenario.scenario import Scenario
from kinemimic.train.scenario.scenario_file import find_scenario

ROLLOUT = 0  # from phase 0
AT, SECONDS = 4.0, 10.0  # default time of the screenshot and maximum duration of the video, s
VIEW = "view.rrd"
FILE = click.Path(path_type=Path, dir_okay=False)


def view(run: Path) -> Path:
    """Write view.rrd into the run folder and return its path.

    Reads motion.json and trajectory.npz and, if present, scores.json and the capture (raw.parquet,
    capture.parquet). The file includes its layout; nothing is served or sent.
    """
    return _record(run)[0]


def view_trial(
    run: Path, scenario: Scenario, *, number: int = 0, seed: int = 0, engine: str = "auto"
) -> Path:
    """Roll out the run's policy in a scenario trial, write view-NAME.rrd and return its path.

    number, seed: of the trial, as in `disturb`; engine: see `train/sim/engines.py`.
    """
    return _record_trial(run, scenario, number, seed, engine)[0]


def _record(run: Path) -> tuple[Path, Scene]:
    """The recording of a run, and the scene of a film of it."""
    with stage(run, "view") as out:
        return run / VIEW, _write_view(run, out / VIEW)


def _write_view(run: Path, path: Path) -> Scene:
    motion = read_motion_json(run / "motion.json")
    trajectory = Trajectory.load(run / "trajectory.npz", motion)
    scores = read_scores(run / "scores.json") if (run / "scores.json").exists() else None
    if scores is not None:
        made_from = scores["provenance"]["inputs"]["motion"]
        require_same_motion(run / "scores.json", made_from, motion, stage="evaluate")
    pair, phases = humanoids(trajectory, ROLLOUT, motion.offsets), trajectory.phases[ROLLOUT]
    shown = captured_skeleton(run, phases, frame_times(len(phases)), pair[0], cyclic=motion.cyclic)
    text = caption(motion, trajectory, ROLLOUT, scores, None if shown is None else shown.legend())
    write_recording(path, trajectory, pair, text, shown=shown)
    return scene_of(trajectory, motion, ROLLOUT)


def _record_trial(
    run: Path, scenario: Scenario, number: int, seed: int, engine: str = "auto"
) -> tuple[Path, Scene]:
    """The recording of a scenario trial, and the scene of a film of it."""
    name = f"view-{scenario.name}.rrd"
    with stage(run, f"view {scenario.name}") as out:
        return run / name, _write_trial(run, out / name, scenario, number, seed, engine)


def _write_trial(run: Path, path: Path, scenario: Scenario, number: int, seed: int, engine: str) -> Scene:
    motion, policy, record = load_trained(run)
    config = TrainConfig.from_json(record["config"])
    trajectory, disturbances = replay_scenario(
        motion, policy, config, scenario, number=number, seed=seed, engine=engine
    )
    text = trial_caption(motion, trajectory, scenario, number)
    pair = humanoids(trajectory, ROLLOUT, motion.offsets)
    write_recording(path, trajectory, pair, text, disturbances=disturbances)
    scene = scene_of(trajectory, motion, ROLLOUT)
    return replace(scene, others=disturbance_solids(pair[1], disturbances))


def write_recording(
    path: Path,
    trajectory: Trajectory,
    pair: tuple[Humanoid, Humanoid],
    text: str,
    *,
    disturbances: Disturbances | None = None,
    shown: CapturedSkeleton | None = None,
) -> None:
    """Write a trajectory's first rollout as a rerun recording, atomically.

    pair: its `humanoids`; text: Markdown shown beside them.
    """
    # Viewers merge recordings with the same id, so it must differ between runs, and only between runs.
    identity = content_hash({"root": trajectory.root[ROLLOUT], "rotations": trajectory.rotations[ROLLOUT]})[
        :32
    ]
    stream = rr.RecordingStream("kinemimic", recording_id=identity, send_properties=False)
    # Into memory: rerun's file sink logs that the disk is full and carries on.
    recorded = stream.memory_recording()
    stream.send_blueprint(layout(capture=shown is not None), make_active=False, make_default=True)
    log_scenes(stream, *pair)
    log_contacts(stream, pair[1], trajectory.contact_forces[ROLLOUT])
    if disturbances is not None:
        log_disturbances(stream, pair[1], disturbances)
    if shown is not None:
        log_skeleton(stream, shown)
    place_side_by_side(stream, (SIMULATED, REFERENCE) if shown is None else (SIMULATED, REFERENCE, CAPTURED))
    log_curves(stream, trajectory, ROLLOUT)
    stream.log("scores", rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN), static=True)
    with atomic(path) as temporary:
        temporary.write_bytes(recorded.drain_as_bytes())
    stream.disconnect()


def how_to_open(recording: Path) -> str:
    """The command that opens a recording; with the environment's viewer if none is on the PATH.

    Without --bind, the viewer would accept connections from the network.
    """
    viewer = "rerun" if shutil.which("rerun") else str(Path(sys.executable).with_name("rerun"))
    return f"open it with: {viewer} --bind 127.0.0.1 {shlex.quote(str(recording))}"


def _evaluate_if_needed(run: Path) -> None:
    # A trial of a scenario is simulated; it needs no scores.
    of_trial = click.get_current_context().params.get("named") is not None
    if not of_trial and not evaluated(run):
        from kinemimic.evaluate.scoring.evaluate import evaluate  # noqa: PLC0415 (--help must not load it)

        evaluate(run)


def _check_options(given: Mapping[str, Any]) -> None:
    """Before a policy is evaluated for `view`, which takes a minute."""
    if given["named"] is None and (given["number"] or given["seed"]):
        raise click.UsageError("--trial and --seed need --scenario")
    if given["picture"] is None and given["at"] is not None:
        raise click.UsageError("--at needs --screenshot")
    if given["movie"] is not None:
        require_encoder(given["movie"])
    elif without := [name for name in ("seconds", "size", "camera", "theme") if given[name] is not None]:
        raise click.UsageError(f"--{without[0]} needs --video")


class _Size(click.ParamType[tuple[int, int]]):
    """Width and height of a picture, such as 1280x720."""

    name = "WxH"

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[int, int]:
        found = re.fullmatch(r"(\d{1,5})x(\d{1,5})", str(value))
        width, height = (int(found[1]), int(found[2])) if found else (0, 0)
        low, high = SIZES
        if not (low <= width <= high and low <= height <= high):
            self.fail(
                f"expected WIDTHxHEIGHT from {low}x{low} to {high}x{high} pixels, found {value!r}", param
            )
        return width, height


@click.command("view")
@run_options(check=_check_options, then=_evaluate_if_needed)
@click.option("--screenshot", "picture", type=PngPath(), help="Also render the recording as PNG (*).")
@click.option("--at", type=FiniteRange(min=0), help=f"Time of the screenshot in s. Default: {AT:g}.")
@click.option("--video", "movie", type=FILE, help="Also write a video (.webm) of humanoid and reference.")
@click.option(
    "--seconds", type=FiniteRange(min=0.1), help=f"Maximum length of the video, s. Default: {SECONDS:g}."
)
@click.option("--size", type=_Size(), help=f"Size of the video, pixels. Default: {SIZE[0]}x{SIZE[1]}.")
@click.option(
    "--camera",
    type=click.Choice(CAMERAS),
    help="Camera of the video: `follow` films from behind, `side` at a right angle. Default: follow.",
)
@click.option("--theme", type=click.Choice(tuple(LOOKS)), help="Background of the video. Default: light.")
@click.option("--scenario", "named", metavar="NAME", help="Show a trial of this scenario, in view-NAME.rrd.")
@click.option(
    "--trial", "number", type=click.IntRange(min=0), default=0, show_default=True, help="Number of the trial."
)
@seed_option("Random seed of the trials.")
@json_option("Print the paths as JSON.")
def command(
    run: Path,
    picture: Path | None,
    at: float | None,
    movie: Path | None,
    seconds: float | None,
    size: tuple[int, int] | None,
    camera: str | None,
    theme: str | None,
    named: str | None,
    number: int,
    seed: int,
    as_json: bool,
) -> None:
    """Write reference, simulated humanoid, capture, curves and scores as a rerun recording.

    A shipped policy (--policy) is evaluated first if necessary, but not for --scenario. Green arrows: contact
    forces, 1000 N per metre. With --scenario: a trial of `disturb`, with its obstacles and forces (red
    arrows, 200 N per metre). White joints: the capture as read; pink: inferred by the sensor.

    A video shows humanoid and reference (blue) at real speed; after a fall the humanoid is grey. Browsers
    play .webm; .mp4 needs an H.264 encoder.

    (*) Needs a Vulkan driver, but no screen.

    \b
      kinemimic view --run runs/walk
      kinemimic view --run runs/walk --video walk.webm --size 1280x720 --camera side
      kinemimic view --policy walk --scenario room --trial 3
    """
    say(unfinished_rollouts(run) if named is None else unfinished_policy(run))
    recording, scene = (
        _record(run) if named is None else _record_trial(run, find_scenario(named), number, seed)
    )
    if picture is not None:
        # Import cost: the viewer's client.
        from kinemimic.evaluate.view.screenshot import screenshot  # noqa: PLC0415

        screenshot(recording, picture, timeline=TIMELINE, seconds=AT if at is None else at)
    if movie is not None:
        write_movie(
            movie, scene, seconds=seconds or SECONDS, size=size or SIZE, camera=camera or CAMERAS[0],
            theme=theme or "light",
        )  # fmt: skip
    write_index(run)
    made = {"recording": recording, "screenshot": picture, "video": movie}
    if as_json:
        click.echo(json.dumps({name: path and path.as_posix() for name, path in made.items()}))
    else:
        echo(f"{recording} ({how_to_open(recording)})")
        for path in filter(None, (picture, movie)):
            echo(str(path))
