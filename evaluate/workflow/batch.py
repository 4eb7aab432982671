"""`kinemimic batch`: the motions of many captures, and one table of what became of each.

Every capture has its run folder below the output folder and is processed in a worker process of limited time
and memory, so that a damaged capture costs only its own row.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from kinemimic.evaluate.workflow.run import passed_on, stage_options
from kinemimic.pipeline.cli.main import BAD_INPUT
from kinemimic.pipeline.cli.options import Decorator, json_option
from kinemimic.pipeline.cli.progress import progress
from kinemimic.pipeline.cli.terminal import show
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.provenance import provenance
from kinemimic.pipeline.files.store import write_json, write_text
from kinemimic.pipeline.filters.options import ingest_options
from kinemimic.retarget.options import retarget_options

BATCH_SCHEMA = 1
TIMEOUT = 300.0
STAGE_OPTIONS: Mapping[str, Decorator] = {"ingest": ingest_options, "retarget": retarget_options}


def batch(
    sources: Sequence[Path],
    out: Path,
    *,
    options: Mapping[str, Mapping[str, Any]] | None = None,
    jobs: int = 1,
    timeout: float = TIMEOUT,
    overwrite: bool = False,
) -> dict[str, Any]:
    """Make the motions of all captures at `sources` below `out`; writes batch.json and batch.csv.

    sources: files, and folders that are searched; options: stage -> its command's options, as `workflow.run`
    takes them; jobs: captures processed at once; timeout: seconds allowed for one capture; overwrite: also
    process captures whose result is up to date. Returns the content of batch.json. A capture that is refused,
    crashes or takes too long is a row with the reason. An interrupted batch writes the rows of the captures
    that are finished; called again, it goes on with the others. KinemimicError without a capture.
    """
    # Import cost: these load the stages.
    from kinemimic.evaluate.workflow.batch_capture import (  # noqa: PLC0415
        Task,
        failed_row,
        kept_row,
        process,
        remove_partial,
    )
    from kinemimic.pipeline.parallel.task_pool import Failure, isolated_map  # noqa: PLC0415

    config = {stage: dict(chosen) for stage, chosen in (options or {}).items() if chosen}
    tasks = [Task(file, folder, config) for file, folder in run_folders(sources, out).items()]
    rows = (
        {} if overwrite else {k: row for k, task in enumerate(tasks) if (row := kept_row(task)) is not None}
    )
    waiting = [k for k in range(len(tasks)) if k not in rows]
    try:
        with progress("batch", len(waiting), unit="captures") as bar:
            outcomes = isolated_map(process, [tasks[k] for k in waiting], workers=jobs, timeout=timeout)
            for index, outcome in outcomes:
                k = waiting[index]
                rows[k] = failed_row(tasks[k], outcome.reason) if isinstance(outcome, Failure) else outcome
                bar.advance(finished=tasks[k].capture.name)
    except KeyboardInterrupt:
        for k in set(waiting) - set(rows):
            remove_partial(tasks[k])
        _write(out, [rows[k] for k in sorted(rows)], config)
        raise KeyboardInterrupt(
            f"{out}: {len(rows)} of {len(tasks)} files done; run the same command again to go on"
        ) from None
    return _write(out, [rows[k] for k in sorted(rows)], config)


def run_folders(sources: Sequence[Path], out: Path) -> dict[Path, Path]:
    """The files at `sources`, except those below `out`, and their run folders.

    A run folder has the path of its file, below `out` instead of the folder that all sources share.
    KinemimicError for a source that does not exist.
    """
    from kinemimic.pipeline.inspect.batch import find_files  # noqa: PLC0415 (import cost)

    for source in sources:
        if not source.exists():
            raise KinemimicError(f"{source}: expected a capture or a folder of captures, found nothing there")
    files = find_files(sources)
    # A depth recording is a folder that counts as a file.
    roots = (source if source.is_dir() and source not in files else source.parent for source in sources)
    shared = os.path.commonpath([root.absolute() for root in roots])
    return {
        file: out / os.path.relpath(file.absolute(), shared)
        for file in files
        if not file.absolute().is_relative_to(out.absolute())
    }


def _write(out: Path, rows: Sequence[dict[str, Any]], config: Mapping[str, Any]) -> dict[str, Any]:
    """Write batch.json and batch.csv; returns the content of batch.json."""
    from kinemimic.evaluate.workflow.batch_table import counts, rows_csv  # noqa: PLC0415 (import cost)
    from kinemimic.pipeline.inspect.file_report import OTHER  # noqa: PLC0415 (import cost)

    read: list[dict[str, Any]] = []
    beside: set[Path] = set()  # of two files that are read with each other, the first is the capture
    for row in rows:
        file = Path(row["file"])
        if row["status"] != OTHER and file not in beside:
            read.append(row)
            beside |= {file.with_name(name) for name in row["sidecar_files"]}
    result = {
        "schema": BATCH_SCHEMA,
        "counts": counts(read),
        "captures": read,
        "other": {row["file"]: row["reason"] for row in rows if row["status"] == OTHER},
        "provenance": provenance(
            "batch",
            inputs={row["file"]: row["sha256"] for row in read if row["sha256"]},
            config=config,
        ),
    }
    if rows:
        write_json(out / "batch.json", result)
        write_text(out / "batch.csv", rows_csv(read))
    return result


@click.command("batch")
@click.argument("sources", nargs=-1, required=True, metavar="SOURCE...",
                type=click.Path(path_type=Path))  # fmt: skip
@click.option("--out", type=click.Path(path_type=Path, file_okay=False), required=True,
              help="Folder of the run folders and of the table.")  # fmt: skip
@click.option("-j", "--jobs", type=click.IntRange(min=1),
              help="Captures processed in parallel; default: one per core.")  # fmt: skip
@click.option("--timeout", type=click.FloatRange(min=0, min_open=True), default=TIMEOUT, show_default=True,
              help="Seconds allowed for one capture.")  # fmt: skip
@click.option("--overwrite", is_flag=True, help="Also process captures whose result is up to date.")
@json_option("Print batch.json.")
def command(
    sources: tuple[Path, ...],
    out: Path,
    jobs: int | None,
    timeout: float,
    overwrite: bool,
    as_json: bool,
    **options: Any,
) -> int:
    """Make the motion of every capture at SOURCE (files, and folders with all their subfolders).

    Every capture goes through ingest, convert and retarget in its own run folder below --out. The table says
    which motions `train` accepts, and why the others were refused. Captures whose result is up to date are
    skipped. Exit status: 0 if any motion is accepted, else 2.

    \b
      kinemimic batch recordings/ --out runs/recordings
      kinemimic batch walk.skl run.bvh --out runs/both --as-recorded
    """
    result = batch(
        sources,
        out,
        options=stage_options(STAGE_OPTIONS, options),
        jobs=jobs or len(os.sched_getaffinity(0)),
        timeout=timeout,
        overwrite=overwrite,
    )
    if as_json:
        click.echo(json.dumps(result, indent=2))
    elif not result["captures"]:
        reasons = list(result["other"].values()) or ["it is empty"]
        more = f"; {len(reasons) - 1} other files are no captures either" if len(reasons) > 1 else ""
        raise KinemimicError(f"{sources[0]}: expected captures, found none: {reasons[0]}{more}")
    else:
        from kinemimic.evaluate.workflow.batch_table import tables  # noqa: PLC0415 (import cost)

        show(*tables(result["captures"], result["counts"]))
        click.echo(f"\nbatch: {out / 'batch.json'}, {out / 'batch.csv'}")
    return 0 if result["counts"]["accepted"] else BAD_INPUT


command.params[-1:-1] = passed_on(STAGE_OPTIONS)
