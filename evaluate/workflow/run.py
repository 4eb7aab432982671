"""`kinemimic run`: every stage on one capture, skipping what is up to date.

A stage is skipped if its entry in run.json (pipeline/run_folder) is still valid; after a stage that
runs, all later stages run too. An interrupted run resumes where it stopped, the training from its checkpoint.
"""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import nullcontext, redirect_stdout
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import click

from kinemimic.evaluate.workflow.start import default_start, require_start, without_training
from kinemimic.pipeline.cli.main import load_command
from kinemimic.pipeline.cli.options import (
    Decorator,
    json_option,
    option_group,
    overwrite_option,
    run_option,
)
from kinemimic.pipeline.cli.passed_on import passed_on, stage_options
from kinemimic.pipeline.cli.progress import activity
from kinemimic.pipeline.files.stages import VIRTUAL_CAPTURE
from kinemimic.pipeline.files.store import read_json
from kinemimic.pipeline.filters.options import ingest_options
from kinemimic.pipeline.run_folder.capture import default_run, require_same_capture, sources_of
from kinemimic.pipeline.run_folder.lock import locked
from kinemimic.pipeline.run_folder.stage import stage, state_options, up_to_date
from kinemimic.retarget.options import retarget_options
from kinemimic.train.options import training_options
from kinemimic.train.sim.options import engine_option, workers_option

VIRTUAL_SEED = 0
# The options of stages that `run` passes on.
STAGE_OPTIONS: Mapping[str, Decorator] = {
    "ingest": ingest_options,
    "retarget": retarget_options,
    "train": option_group(training_options, workers_option),
    "evaluate": option_group(engine_option, workers_option),
}
# The stages that `run` carries out, in this order.
RUN_STAGES = ("ingest", "convert", "retarget", "train", "evaluate", "view")


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
    stages: Sequence[str] = RUN_STAGES,
    policy: str | None = None,
    from_scratch: bool = False,
    overwrite: bool = False,
    quiet: bool = False,
) -> Outcome:
    """Run all stages on a capture, up to scores, report and recording in `folder`.

    capture: a file or folder, or None to record the stock walk with the virtual Kinect (folder/capture).
    options: stage -> its command's options without the dashes; True is a flag, None the command's default.
    stages: the first stages of RUN_STAGES, to stop before `evaluate` and its scores. policy: a tracker, by
    name or folder, which performs the motion instead of training. from_scratch: train from random weights;
    otherwise training starts from a shipped tracker, unless the options name a start or a preset.
    overwrite: set the results of another capture in the folder aside, instead of refusing. quiet: print
    nothing.
    Raises what the stages raise; finished stages stay recorded.
    """
    source = folder / VIRTUAL_CAPTURE if capture is None else capture
    options = options or {}
    if policy is not None:
        stages, options = without_training(policy, stages, options, from_scratch=from_scratch)
    require_start(options.get("train", {}), from_scratch=from_scratch)
    ran: list[str] = []
    skipped: list[str] = []
    with locked(folder):
        if not overwrite:
            require_same_capture(folder, source)
        for step in _steps(source, folder, stages, virtual=capture is None, quiet=quiet):
            config = {key: value for key, value in options.get(step.name, {}).items() if value is not None}
            if step.name == "train" and not (from_scratch or config.keys() & {"from", "preset"}):
                config |= default_start(folder)
            if not ran and up_to_date(folder, step.name, sources=step.sources, options=config):
                skipped.append(step.name)
                _say(f"{step.name}: up to date", quiet=quiet)
                continue
            _say(step.name, quiet=quiet, bold=True)
            step.work([f"--{key}" if value is True else f"--{key}={value}" for key, value in config.items()])
            state_options(folder, step.name, config)
            ran.append(step.name)
        scored = "evaluate" in stages
        return Outcome(tuple(ran), tuple(skipped), read_json(folder / "scores.json") if scored else {})


@dataclass(frozen=True)
class _Step:
    """A stage of a run.

    sources: files from outside the folder that its result depends on; work: runs it, with the flags of its
    options.
    """

    name: str
    sources: Mapping[str, Path]
    work: Callable[[list[str]], None]


def _steps(
    source: Path, folder: Path, stages: Sequence[str], *, virtual: bool, quiet: bool
) -> Iterator[_Step]:
    """The stages in order; virtual: first, the virtual Kinect records `source`.

    One at a time, because the files of `source` are known only once it has been recorded.
    """
    if virtual:
        yield _Step("virtual", {}, lambda _: _record_virtual(folder, source, quiet=quiet))
    for name in stages:
        ingests = name == "ingest"
        arguments = [str(source), "--overwrite"] if ingests else []
        sources = sources_of(folder, source) if ingests else {}
        yield _Step(name, sources, partial(_invoke, name, [*arguments, "--run", str(folder)], quiet=quiet))


def _record_virtual(folder: Path, source: Path, *, quiet: bool) -> None:
    from kinemimic.pipeline.virtual_kinect.recorder import record_virtual  # noqa: PLC0415 (import cost)

    with stage(folder, "virtual") as out:
        record_virtual((out / VIRTUAL_CAPTURE).parent, seed=VIRTUAL_SEED)
    _say(f"SIMULATED capture: the virtual Kinect records the stock walk: {source}", quiet=quiet)


def _invoke(name: str, arguments: list[str], flags: list[str], *, quiet: bool) -> None:
    """Run a command as from the command line; the table of scores is held back until the end."""
    command = load_command(name)
    arguments = [*arguments, *flags, *(["--json"] if quiet else [])]
    with (
        redirect_stdout(io.StringIO()) if quiet or name == "evaluate" else nullcontext(),
        activity(name),
        command.make_context(name, arguments, parent=click.get_current_context(silent=True)) as context,
    ):
        command.invoke(context)


def _say(text: str, *, quiet: bool, bold: bool = False) -> None:
    if not quiet:
        click.secho(text, bold=bold)


@click.command()
@click.argument("capture", required=False, type=click.Path(path_type=Path))
@run_option("folder", default=None)
@click.option(
    "--policy",
    metavar="POLICY",
    help="Perform the motion with a tracker instead of training: a folder with one, or `tracker`, which is "
    "replaced by `standing` for a motion without strides.",
)
@click.option(
    "--from-scratch",
    is_flag=True,
    help="Train from random weights instead of a shipped tracker. Takes several times as long.",
)
@overwrite_option
@json_option("Print the stages that were run, and the scores, as JSON.")
def command(
    capture: Path | None,
    folder: Path | None,
    policy: str | None,
    from_scratch: bool,
    overwrite: bool,
    as_json: bool,
    **options: Any,
) -> None:
    """Run every stage on CAPTURE, up to the scores; without CAPTURE, on a walk of the virtual Kinect.

    Stages whose inputs and options have not changed are skipped. The run folder is named after the capture.
    Training starts from a shipped tracker: on a walk or run from `tracker`, on a motion without strides from
    `standing`. On other motions it starts from scratch.

    \b
      kinemimic run
      kinemimic run walk.skl --run runs/walk
      kinemimic run walk.skl --policy tracker
      kinemimic run walk.skl --from-scratch --budget 1M
    """
    folder = folder or default_run(capture)
    given = stage_options(STAGE_OPTIONS, options)
    outcome = run(
        capture,
        folder,
        options=given,
        policy=policy,
        from_scratch=from_scratch,
        overwrite=overwrite,
        quiet=as_json,
    )
    from kinemimic.evaluate.scoring.reports.index_page import write_index  # noqa: PLC0415 (import cost)

    write_index(folder)
    report, recording = folder / "report.html", folder / "view.rrd"
    if as_json:
        paths = {"report": report.as_posix(), "recording": recording.as_posix()}
        stages = {"ran": list(outcome.ran), "skipped": list(outcome.skipped)}
        click.echo(json.dumps({**stages, **paths, "scores": outcome.scores}, indent=2))
        return
    # Import cost: these modules load the simulation.
    from kinemimic.evaluate.scoring.evaluate import table  # noqa: PLC0415
    from kinemimic.evaluate.view.command import how_to_open  # noqa: PLC0415
    from kinemimic.pipeline.cli.terminal import show  # noqa: PLC0415

    click.echo()
    # Without wrapping: a path broken over two lines cannot be opened.
    show(table(dict(outcome.scores), folder), wrap=False)
    click.echo(f"recording: {recording} ({how_to_open(recording)})")


command.params[-1:-1] = passed_on(STAGE_OPTIONS)
