"""`kinemimic inspect`: the format and quality of capture files, and the effect of `ingest` on them."""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from kinemimic.pipeline.cli.main import BAD_INPUT, INTERRUPTED
from kinemimic.pipeline.cli.options import jobs_option, json_option, rate_option, unit_option
from kinemimic.pipeline.cli.printable import echo
from kinemimic.pipeline.cli.progress import progress
from kinemimic.pipeline.cli.terminal import show
from kinemimic.pipeline.errors import CaptureError, KinemimicError
from kinemimic.pipeline.inspect.batch import (
    file_reports,
    file_sections,
    folder_summaries,
    mark_sidecar_files,
)
from kinemimic.pipeline.inspect.file_report import FLAGGED, OTHER, SIDECAR, USABLE
from kinemimic.pipeline.inspect.file_view import file_view
from kinemimic.pipeline.inspect.files_table import files_table
from kinemimic.pipeline.readers.search import find_files


@click.command()
@click.argument("paths", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--plot",
    type=click.Path(path_type=Path, dir_okay=False),
    help="Plot the curves of the first 40 captures to this HTML page.",
)
@json_option("Print the reports as JSON.")
@click.option("--files", "by_file", is_flag=True, help="Show a row per file, not only per folder.")
@click.option(
    "--suggest", is_flag=True, help="Only draft a TOML description of the columns of one custom table."
)
@unit_option("Length unit of the files. Default: as declared by the format, or inferred from body size.")
@rate_option("True frame rate of the files in Hz. Default: from each file's clock.")
@jobs_option("Files inspected in parallel.")
def command(
    paths: tuple[Path, ...],
    plot: Path | None,
    as_json: bool,
    by_file: bool,
    suggest: bool,
    unit: str | None,
    rate: float | None,
    jobs: int | None,
) -> int:
    """Report the format and quality of each capture in PATHS, and what `ingest` will do with it.

    One file: a full report; several files or a folder: a table. Files that are not captures are only
    listed. The knee peak is the 95th percentile over the frames in passes, on the better-tracked side; ranges
    are the 5th to the 95th percentile. Exit status: 0 if any file is usable, else 2.

    \b
      kinemimic inspect walk.skl
      kinemimic inspect recordings/ --plot curves.html
      kinemimic inspect --suggest walk.csv > walk.toml
    """
    if suggest:
        return _suggest(paths)
    files = find_files(paths)
    if not files:
        raise KinemimicError(f"{paths[0]}: expected a capture or a folder of captures, found an empty folder")
    if not any(os.path.lexists(file) for file in files):
        raise KinemimicError(
            f"{files[0]}: expected a capture or a folder of captures, found no file; check the name"
        )
    at_once = jobs or _processors()
    found: list[dict[str, Any]] = []
    status = 0
    try:
        with progress("inspect", len(files), unit="files") as bar:
            for one in file_reports(files, jobs=at_once, unit=unit, rate=rate):
                found.append(one)
                bar.advance()
    except KeyboardInterrupt:
        echo(f"kinemimic: interrupted after {len(found)} of {len(files)} files", err=True)
        status = INTERRUPTED
    if not found:
        return status
    reports = mark_sidecar_files(found)
    if plot:
        _write_page(plot, reports, jobs=at_once, unit=unit, rate=rate)
    if as_json:
        click.echo(
            json.dumps({"files": reports, "folders": folder_summaries(reports)}, indent=2, allow_nan=False)
        )
    else:
        show(file_view(reports[0]) if len(files) == 1 else files_table(reports, by_file=by_file))
    if status == 0 and not any(report["status"] in (USABLE, FLAGGED) for report in reports):
        status = BAD_INPUT
    return status


def _suggest(paths: Sequence[Path]) -> int:
    """Print a draft description of a custom table; note on stderr if the file can be read without one."""
    from kinemimic.pipeline.readers.custom_table.suggest import suggest  # noqa: PLC0415
    from kinemimic.pipeline.readers.recognise import open_capture, reader_of  # noqa: PLC0415 (loads every reader)

    if len(paths) != 1:
        raise KinemimicError(f"expected one file with --suggest, found {len(paths)}")
    source = open_capture(paths[0])
    with contextlib.suppress(CaptureError):
        known = reader_of(source).FORMAT.name
        echo(f"kinemimic: {paths[0]} needs no description: it is read as {known}", err=True)
    echo(suggest(source), nl=False)
    return 0


def _write_page(
    path: Path, reports: Sequence[dict[str, Any]], *, jobs: int, unit: str | None, rate: float | None
) -> None:
    """Write the page; its captures are read again, since keeping all clips would take too much memory."""
    from kinemimic.pipeline.inspect.curves import MAX_PLOTTED, write_page  # noqa: PLC0415 (loads matplotlib)

    captures = [report for report in reports if report["status"] not in (OTHER, SIDECAR)]
    files = [Path(report["file"]) for report in captures[:MAX_PLOTTED]]
    drawn: dict[Path, str] = {}
    with progress("plot", len(files), unit="files") as bar:
        for file, section in file_sections(files, jobs=jobs, unit=unit, rate=rate):
            drawn[file] = section
            bar.advance()
    write_page(path, captures, [drawn[file] for file in files])


def _processors() -> int:
    return len(os.sched_getaffinity(0))
