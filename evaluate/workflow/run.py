"""`kinemimic run`: every stage on one capture, skipping what is up to date.

A stage is skipped if its entry in run.json (run_record.py) is still valid; after a stage that runs, all later
stages run too. An interrupted run resumes where it stopped, the training from its checkpoint.
"""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext, redirect_stdout
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import click

from kinemimic.evaluate.workflow.run_record import RunRecord, stage_inputs
from kinemimic.pipeline.cli.main import load_command
from kinemimic.pipeline.cli.options import Decorator, declared, json_option, run_option
from kinemimic.pipeline.files.sidecars import note_path, truth_path
from kinemimic.pipeline.files.store import read_json
from kinemimic.pipeline.filters.options import ingest_options
from kinemimic.retarget.options import retarget_options
from kinemimic.train.options import training_options
from kinemimic.train.sim.options import engine_option

# Without a capture, `run` records one with the virtual Kinect, always the same one.
VIRTUAL_STAGE = "virtual"
VIRTUAL_SEED = 0
VIRTUAL_CAPTURE = "capture/kinect_walk_euler.bvh"
VIRTUAL_FILES = (
    VIRTUAL_CAPTURE,
    "capture/kinect_walk_euler.truth.parquet",
    "capture/kinect_walk_euler.provenance.json",
)

# The options of stages that `run` passes on.
STAGE_OPTIONS: Mapping[str, Decorator] = {
    "ingest": ingest_options,
    "retarget": retarget_options,
    "train": training_options,
    "evaluate": engine_option,
}


@dataclass(frozen=True)
class Stage:
    """A command, and the files of the run folder that it reads (if present) and writes."""

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
    """The stages that were run and skipped, and the content of scores.json (empty without `evaluate`)."""

    ran: tuple[str, ...]
    skipped: tuple[str, ...]
    scores: Mapping[str, Any]


def run(
    capture: Path | None,
    folder: Path,
    *,
    options: Mapping[str, Mapping[str, Any]] | None = None,
    stages: Sequence[Stage] = STAGES,
    quiet: bool = False,
) -> Outcome:
    """Run all stages on a capture, up to scores, report and recording in `folder`.

    capture: a file or folder, or None to record the stock walk with the virtual Kinect (folder/capture).
    options: stage -> its command's options without the dashes; True is a flag, None the command's default.
    stages: the first few of STAGES, to stop before `evaluate` and its scores. quiet: print nothing.
    Raises what the stages raise; finished stages stay recorded.
    """
    run_record = RunRecord(folder)
    ran: list[str] = []
    skipped: list[str] = []

    def step(
        name: str, reads: Callable[[], Mapping[str, Path]], writes: tuple[str, ...], arguments: list[str]
    ) -> None:
        config = {key: value for key, value in (options or {}).get(name, {}).items() if value is not None}
        if not ran and run_record.up_to_date(name, stage_inputs(reads(), config)):
            skipped.append(name)
            _say(f"{name}: up to date", quiet=quiet)
            return
        _say(f"{name}", quiet=quiet, bold=True)
        if name == VIRTUAL_STAGE:
            _record_virtual(folder)
            _say(f"SIMULATED capture: the virtual Kinect records the stock walk: {capture}", quiet=quiet)
        else:
            flags = [f"--{key}" if value is True else f"--{key}={value}" for key, value in config.items()]
            _invoke(name, [*arguments, "--run", str(folder), *flags], quiet=quiet)
        # After the stage, because `ingest` reports the sidecar files that it read.
        run_record.record(name, stage_inputs(reads(), config), writes)
        ran.append(name)

    if capture is None:
        capture = folder / VIRTUAL_CAPTURE
        step(VIRTUAL_STAGE, dict, VIRTUAL_FILES, [])
    source = capture

    def read_by(stage: Stage) -> Mapping[str, Path]:
        if stage.name == "ingest":
            return capture_files(source, folder)
        return {name: folder / name for name in stage.reads}

    for stage in stages:
        step(
            stage.name,
            partial(read_by, stage),
            stage.writes,
            [str(capture)] if stage.name == "ingest" else [],
        )
    scored = any("scores.json" in stage.writes for stage in stages)
    return Outcome(tuple(ran), tuple(skipped), read_json(folder / "scores.json") if scored else {})


def capture_files(capture: Path, folder: Path) -> dict[str, Path]:
    """The capture and its sidecar files: those with fixed names, and those that the last `ingest` reported.

    For a folder (a depth recording): every file in it.
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
    from kinemimic.pipeline.virtual_kinect.recorder import record_virtual  # noqa: PLC0415 (import cost)

    record_virtual((folder / VIRTUAL_CAPTURE).parent, seed=VIRTUAL_SEED)


def _invoke(name: str, arguments: list[str], *, quiet: bool) -> None:
    """Run a command as from the command line; the table of scores is held back until the end."""
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


def passed_on(groups: Mapping[str, Decorator]) -> list[click.Option]:
    """The options of the stages in `groups`; unset, each leaves its stage the default."""
    options: dict[str, click.Option] = {}
    stages: dict[str, list[str]] = {}
    for stage, group in groups.items():
        for option in declared(group):
            options[option.opts[0]] = option
            stages.setdefault(option.opts[0], []).append(stage)
    for name, option in options.items():
        default = name.removeprefix("--") if option.default is True else option.default
        shown = f"; default: {default}" if option.show_default else ""
        option.help = f"{option.help} [{', '.join(stages[name])}{shown}]"
        option.default, option.show_default = None, False
    return list(options.values())


def stage_options(groups: Mapping[str, Decorator], values: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Stage -> the options that were set, as `run` takes them."""
    options: dict[str, dict[str, Any]] = {}
    for stage, group in groups.items():
        options[stage] = {}
        for option in declared(group):
            value, names = values[option.name or ""], option.opts
            if option.is_flag:
                # --loop/--no-loop: False is the second name.
                names, value = (option.secondary_opts, True) if value is False else (names, value)
            if value is not None and names:
                options[stage][names[0].removeprefix("--")] = value
    return options


@click.command()
@click.argument("capture", required=False, type=click.Path(path_type=Path))
@run_option("folder")
@json_option("Print the stages that were run, and the scores, as JSON.")
def command(capture: Path | None, folder: Path, as_json: bool, **options: Any) -> None:
    """Take CAPTURE, or the virtual Kinect's recording of a walk, through every stage to its scores.

    Stages whose inputs and options have not changed are skipped.

    \b
      kinemimic run
      kinemimic run walk.skl --run runs/walk --budget 1M
    """
    outcome = run(capture, folder, options=stage_options(STAGE_OPTIONS, options), quiet=as_json)
    report, recording = folder / "report.html", folder / "view.rrd"
    if as_json:
        paths = {"report": report.as_posix(), "recording": recording.as_posix()}
        stages = {"ran": list(outcome.ran), "skipped": list(outcome.skipped)}
        click.echo(json.dumps({**stages, **paths, "scores": outcome.scores}, indent=2))
        return
    # Import cost: these modules load the simulation.
    from rich.console import Console  # noqa: PLC0415

    from kinemimic.evaluate.scoring.command import table  # noqa: PLC0415
    from kinemimic.evaluate.view.command import how_to_open  # noqa: PLC0415

    click.echo()
    # Without wrapping: a path broken over two lines cannot be opened.
    Console(highlight=False).print(table(dict(outcome.scores), folder), soft_wrap=True)
    click.echo(f"recording: {recording} ({how_to_open(recording)})")


command.params[-1:-1] = passed_on(STAGE_OPTIONS)
