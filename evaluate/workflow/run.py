"""`kinemimic run`: every stage on one capture, skipping what is up to date.

A stage is skipped when its entry in run.json (ledger.py) still holds; one that is run makes all after it run.
An interrupted run goes on where it was, the training from its checkpoint.
"""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Mapping
from contextlib import nullcontext, redirect_stdout
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import click

from kinemimic.evaluate.workflow.ledger import Ledger, made_from
from kinemimic.pipeline.cli.main import load_command
from kinemimic.pipeline.cli.options import json_option, run_option, unit_option
from kinemimic.pipeline.files.sidecars import note_path, truth_path
from kinemimic.pipeline.files.store import read_json
from kinemimic.train.config.budget import MINUTES, samples
from kinemimic.train.config.config import PRESETS
from kinemimic.train.sim.engines import ENGINES

# The capture that `run` makes when it is given none; a virtual Kinect always records the same one.
VIRTUAL_STAGE = "virtual"
# As in `ingest`, whose module is not loaded for --help.
FILTERS = ("kalman", "butterworth", "one-euro", "none")
# As in `retarget`.
ANKLES = ("neutral", "normal")
VIRTUAL_SEED = 0
VIRTUAL_CAPTURE = "capture/kinect_walk_euler.bvh"
VIRTUAL_FILES = (
    VIRTUAL_CAPTURE,
    "capture/kinect_walk_euler.truth.parquet",
    "capture/kinect_walk_euler.provenance.json",
)


@dataclass(frozen=True)
class Stage:
    """A command, and the files of the run folder that it reads (where they are there) and writes."""

    name: str
    reads: tuple[str, ...]
    writes: tuple[str, ...]


STAGES = (
    Stage("ingest", (), ("raw.parquet", "clip.parquet", "quality.json", "truth.parquet")),
    Stage("convert", ("clip.parquet",), ("quaternions.parquet", "gimbal.json", "orientation.json")),
    Stage(
        "retarget",
        ("quaternions.parquet", "raw.parquet", "truth.parquet"),
        ("motion.json", "motion.mcap", "gait.json", "capture.parquet"),
    ),
    Stage("train", ("motion.json",), ("policy.safetensors", "policy.json")),
    Stage(
        "evaluate",
        ("motion.json", "policy.safetensors", "capture.parquet", "quality.json", "gimbal.json", "gait.json"),
        ("scores.json", "curves.csv", "report.html", "trajectory.npz"),
    ),
    Stage("view", ("motion.json", "trajectory.npz", "scores.json"), ("view.rrd",)),
)


@dataclass(frozen=True)
class Outcome:
    """Which stages were run and which skipped, and the content of scores.json."""

    ran: tuple[str, ...]
    skipped: tuple[str, ...]
    scores: Mapping[str, Any]


def run(
    capture: Path | None,
    folder: Path,
    *,
    options: Mapping[str, Mapping[str, Any]] | None = None,
    quiet: bool = False,
) -> Outcome:
    """Take a capture to scores, a report and a recording in `folder`.

    capture: a file, or None for the virtual Kinect's recording of the stock walk (folder/capture).
    options: stage -> its command's options without the dashes; True is a flag, None the command's default.
    quiet: nothing is printed. Raises what the stages raise; those that were finished stay recorded.
    """
    ledger = Ledger(folder)
    ran: list[str] = []
    skipped: list[str] = []

    def step(
        name: str, reads: Callable[[], Mapping[str, Path]], writes: tuple[str, ...], arguments: list[str]
    ) -> None:
        config = {key: value for key, value in (options or {}).get(name, {}).items() if value is not None}
        if not ran and ledger.up_to_date(name, made_from(reads(), config)):
            skipped.append(name)
            _say(f"{name}: up to date", quiet=quiet)
            return
        _say(f"{name}", quiet=quiet, bold=True)
        if name == VIRTUAL_STAGE:
            _record_virtual(folder)
            _say(f"SIMULATED: a virtual Kinect records the stock walk: {capture}", quiet=quiet)
        else:
            flags = [f"--{key}" if value is True else f"--{key}={value}" for key, value in config.items()]
            _invoke(name, [*arguments, "--run", str(folder), *flags], quiet=quiet)
        # Only now is it known which files beside the capture were read with it.
        ledger.record(name, made_from(reads(), config), writes)
        ran.append(name)

    if capture is None:
        capture = folder / VIRTUAL_CAPTURE
        step(VIRTUAL_STAGE, dict, VIRTUAL_FILES, [])
    source = capture

    def read_by(stage: Stage) -> Mapping[str, Path]:
        if stage.name == "ingest":
            return _capture_files(source, folder)
        return {name: folder / name for name in stage.reads}

    for stage in STAGES:
        step(
            stage.name,
            partial(read_by, stage),
            stage.writes,
            [str(capture)] if stage.name == "ingest" else [],
        )
    return Outcome(tuple(ran), tuple(skipped), read_json(folder / "scores.json"))


def _capture_files(capture: Path, folder: Path) -> dict[str, Path]:
    """The capture and what belongs to it: by rule, and by what the last `ingest` read beside it.

    Of a capture that is a folder (a depth recording), every file in it.
    """
    if capture.is_dir():
        return {str(file.relative_to(capture)): file for file in sorted(capture.rglob("*")) if file.is_file()}
    quality = folder / "quality.json"
    report = read_json(quality) if quality.exists() else {}
    sidecar_files = report.get("sidecar_files", {}) if isinstance(report, dict) else {}
    return {
        capture.name: capture,
        "truth.parquet": truth_path(capture),
        "provenance.json": note_path(capture),
        **{name: capture.with_name(name) for name in sidecar_files},
    }


def _record_virtual(folder: Path) -> None:
    # Only this stage needs it, and whoever brings a capture does not wait for it.
    from kinemimic.pipeline.virtual_kinect.recorder import record_virtual  # noqa: PLC0415

    record_virtual((folder / VIRTUAL_CAPTURE).parent, seed=VIRTUAL_SEED)


def _invoke(name: str, arguments: list[str], *, quiet: bool) -> None:
    """Run a command as the command line would; its table of scores is kept back for the end."""
    command = load_command(name)
    if quiet:
        arguments = [*arguments, "--json"]
    with (
        redirect_stdout(io.StringIO()) if quiet or name == "evaluate" else nullcontext(),
        command.make_context(name, arguments, parent=click.get_current_context(silent=True)) as context,
    ):
        command.invoke(context)


def _say(text: str, *, quiet: bool, bold: bool = False) -> None:
    if not quiet:
        click.secho(text, bold=bold)


@click.command()
@click.argument("capture", required=False, type=click.Path(path_type=Path))
@run_option("folder")
@click.option("--filter", "filter_name", type=click.Choice(FILTERS), help="Of `ingest`.")
@unit_option("Of `ingest`.")
@click.option("--symmetric/--as-recorded", default=None, help="Of `retarget`.")
@click.option("--no-refine", is_flag=True, help="Of `retarget`.")
@click.option("--ankle", type=click.Choice(ANKLES), help="Of `retarget`.")
@click.option("--loop/--no-loop", default=None, help="Of `retarget`.")
@click.option("--preset", type=click.Choice(list(PRESETS)), help="Of `train`.")
@click.option("--budget", type=samples, help="Of `train`: samples, such as 1e6; the preset's by default.")
@click.option("--minutes", type=MINUTES, help="Of `train`: its end, if the budget lasts longer.")
@click.option("--seed", type=click.IntRange(min=0), help="Of `train`.")
@click.option("--engine", type=click.Choice(ENGINES), help="Of `train` and `evaluate`.")
@click.option("--anyway", is_flag=True, help="Of `train`: also on a motion that its gate refuses.")
@json_option("Print what was run and the scores as JSON.")
def command(
    capture: Path | None,
    folder: Path,
    filter_name: str | None,
    unit: str | None,
    symmetric: bool | None,
    no_refine: bool,
    ankle: str | None,
    loop: bool | None,
    preset: str | None,
    budget: int | None,
    minutes: float | None,
    seed: int | None,
    engine: str | None,
    anyway: bool,
    as_json: bool,
) -> None:
    """Take CAPTURE (or, without one, the virtual Kinect's walk) through every stage to its scores.

    A stage whose inputs and options have not changed since the last time is skipped.

    \b
      kinemimic run
      kinemimic run walk.skl --run runs/walk --budget 1e6
    """
    options: dict[str, dict[str, Any]] = {
        "ingest": {"filter": filter_name, "unit": unit},
        "retarget": {
            "symmetric": symmetric or None,
            "as-recorded": True if symmetric is False else None,
            "no-refine": no_refine or None,
            "ankle": ankle,
            "loop": loop or None,
            "no-loop": True if loop is False else None,
        },
        "train": {
            "preset": preset,
            "budget": budget,
            "minutes": minutes,
            "seed": seed,
            "engine": engine,
            "anyway": anyway or None,
        },
        "evaluate": {"engine": engine},
    }
    outcome = run(capture, folder, options=options, quiet=as_json)
    report, recording = folder / "report.html", folder / "view.rrd"
    if as_json:
        paths = {"report": report.as_posix(), "recording": recording.as_posix()}
        ledger = {"ran": list(outcome.ran), "skipped": list(outcome.skipped)}
        click.echo(json.dumps({**ledger, **paths, "scores": outcome.scores}, indent=2))
        return
    # The table's module loads the simulation, which `kinemimic run --help` has no use for.
    from rich.console import Console  # noqa: PLC0415

    from kinemimic.evaluate.scoring.command import table  # noqa: PLC0415
    from kinemimic.evaluate.view.command import how_to_open  # noqa: PLC0415

    click.echo()
    # A path that is broken over two lines cannot be opened.
    Console(highlight=False).print(table(dict(outcome.scores), folder), soft_wrap=True)
    click.echo(f"recording: {recording} ({how_to_open(recording)})")
