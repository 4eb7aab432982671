"""`kinemimic inspect`: what capture files are, how good they are, and what will be done to them."""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import click

from kinemimic.pipeline.captures.source import Source
from kinemimic.pipeline.cli import BAD_INPUT, INTERRUPTED
from kinemimic.pipeline.errors import CaptureError, KinemimicError
from kinemimic.pipeline.inspect.sheet import sheet
from kinemimic.pipeline.inspect.study import FLAGGED, USABLE
from kinemimic.pipeline.inspect.summary import summary
from kinemimic.pipeline.inspect.survey import Looked, files_of, folders, look, survey, with_companions
from kinemimic.pipeline.inspect.terminal import show
from kinemimic.pipeline.progress import progress


@click.command()
@click.argument("paths", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--plot", type=click.Path(path_type=Path, dir_okay=False), help="Write curves to this page (HTML)."
)
@click.option("--json", "as_json", is_flag=True, help="Print everything as JSON.")
@click.option("--files", "by_file", is_flag=True, help="A row for each file, not only for each folder.")
@click.option("--suggest", is_flag=True, help="Only draft a description (TOML) of one file's own columns.")
@click.option(
    "--jobs", type=click.IntRange(min=1), help="Files looked at at once.  [default: one a processor]"
)
def command(
    paths: tuple[Path, ...], plot: Path | None, as_json: bool, by_file: bool, suggest: bool, jobs: int | None
) -> int:
    """Say what each capture in PATHS is, how good it is, joint by joint, and what will be done to it.

    One file gives a page, several or a folder a table; files that are no captures are only named. The peak
    of the knee is the 95th percentile of the frames in passes, of the side that was tracked better, and a
    range goes from the 5th to the 95th. Exit status: 0 if a file was read and not refused, 2 if none was.
    """
    if suggest:
        return _suggest(paths)
    files = files_of(paths)
    if not files:
        raise KinemimicError(f"{paths[0]}: expected a capture or a folder of captures, found an empty folder")
    work = partial(look, draw=plot is not None)
    looked: list[Looked] = []
    status = 0
    try:
        if len(files) == 1:
            looked.append(work(files[0]))
        else:
            at_once = min(jobs or _processors(), len(files))
            with progress("inspect", len(files)) as bar:
                for one in survey(files, work, jobs=at_once):
                    looked.append(one)
                    bar.advance()
    except KeyboardInterrupt:
        click.echo(f"kinemimic: interrupted after {len(looked)} of {len(files)} files", err=True)
        status = INTERRUPTED
    if not looked:
        return status
    reports = with_companions(one.report for one in looked)
    if plot:
        _write_page(plot, looked, reports)
    if as_json:
        click.echo(json.dumps({"files": reports, "folders": folders(reports)}, indent=2, allow_nan=False))
    else:
        show(sheet(reports[0]) if len(files) == 1 else summary(reports, by_file=by_file))
    if status == 0 and not any(report["status"] in (USABLE, FLAGGED) for report in reports):
        status = BAD_INPUT
    return status


def _suggest(paths: Sequence[Path]) -> int:
    """Print the draft of a description; a word on stderr if the file is read without one."""
    from kinemimic.pipeline.captures.recognise import reader_of  # noqa: PLC0415 (loads every reader)
    from kinemimic.pipeline.captures.suggest import suggest  # noqa: PLC0415

    if len(paths) != 1:
        raise KinemimicError(f"expected one file with --suggest, found {len(paths)}")
    source = Source.open(paths[0])
    with contextlib.suppress(CaptureError):
        known = reader_of(source).FORMAT.name
        click.echo(f"kinemimic: {paths[0]} needs no description: it is read as {known}", err=True)
    click.echo(suggest(source), nl=False)
    return 0


def _write_page(path: Path, looked: Sequence[Looked], reports: Sequence[dict[str, Any]]) -> None:
    from kinemimic.pipeline.inspect.curves import write_page  # noqa: PLC0415 (loads matplotlib)

    drawings = {one.report["file"]: one.drawings for one in looked}
    write_page(path, [(report, drawings[report["file"]]) for report in reports])


def _processors() -> int:
    return len(os.sched_getaffinity(0))
