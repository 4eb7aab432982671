"""`kinemimic gait`: the gait of the capture, of the reference and of the simulation, side by side."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click
import numpy as np
from rich.console import Console, Group, RenderableType
from rich.table import Table
from rich.text import Text

from kinemimic.evaluate.scoring.gait_page import ROWS, cell, gait_page, notes
from kinemimic.evaluate.scoring.gait_report import compare
from kinemimic.evaluate.scoring.gait_sources import Walker, captured
from kinemimic.pipeline.cli.options import json_option, run_option
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.provenance import provenance
from kinemimic.pipeline.files.store import file_hash, write_json, write_text
from kinemimic.retarget.formats.motion_json import read_motion_json
from kinemimic.train.rollout.trajectory import Trajectory

# Of these one must be there: the playback needs the motion's body.
WALKERS = ("quaternions.parquet", "motion.json")
FILES = ("quaternions.parquet", "clip.parquet", "gait.json", "motion.json", "trajectory.npz")


def gait(run: Path) -> dict[str, Any]:
    """Measure whoever walks in a run folder, write gait_report.json and gait_report.html, return the former.

    A KinemimicError says so where nothing is there, or nobody in it makes a whole stride.
    """
    if not run.is_dir():
        raise KinemimicError(f"{run}: expected a run folder, found none; name one with --run")
    if not any((run / name).exists() for name in WALKERS):
        raise KinemimicError(
            f"{run}: expected {' or '.join(WALKERS)}, found neither; run `ingest` and `convert` first"
        )
    motion = read_motion_json(run / "motion.json") if (run / "motion.json").exists() else None
    trajectory = (
        Trajectory.load(run / "trajectory.npz") if motion and (run / "trajectory.npz").exists() else None
    )
    capture = captured(run, motion)
    report = compare(capture, motion, trajectory)
    if not report["walkers"]:
        raise KinemimicError(
            f"{run}: expected a gait with at least one whole stride, found none in capture, reference or "
            f"simulation{_recorded(capture)}; is it walking or running, for two strides or more?"
        )
    report["provenance"] = provenance(
        "gait", inputs={name: file_hash(run / name) for name in FILES if (run / name).exists()}, config={}
    )
    page = gait_page(run.resolve().name, report)
    write_text(run / "gait_report.html", page)
    write_json(run / "gait_report.json", report)
    return report


def _recorded(capture: Walker | None) -> str:
    """How much of a gait there is in a capture without a whole stride."""
    if capture is None:
        return ""
    seconds = sum(
        float(np.ptp(capture.times[capture.passes == k])) for k in set(capture.passes[capture.passes >= 0])
    )
    strikes = [sum(len(feet.strikes[k]) for feet in capture.gait.feet.values()) for k in range(2)]
    return (
        f"; the capture's {seconds:.1f} s have {strikes[0]} left and {strikes[1]} right foot strikes, of "
        "which a stride takes two of one foot"
    )


def table(report: Mapping[str, Any], run: Path) -> RenderableType:
    """The report for a terminal."""
    walkers = report["walkers"]
    grid = Table("", header_style="bold", box=None, pad_edge=False)
    for name in walkers:
        grid.add_column(name, justify="right")
    for label, unit, digits, scale, read in ROWS:
        cells = [cell(read(walker), digits, scale) for walker in walkers.values()]
        if any(text != "–" for text in cells):
            grid.add_row(f"{label}{f' [{unit}]' if unit else ''}", *cells)
    lines = [*notes(report), f"normal: {report['normative']}", f"curves: {run / 'gait_report.html'}"]
    return Group(grid, *(Text(line) for line in lines))


@click.command("gait")
@run_option()
@json_option("Print gait_report.json.")
def command(run: Path, as_json: bool) -> None:
    """The gait of a run's capture, reference and simulation, whichever are there, over what is normal.

    Cadence, lengths, speed, stance, symmetry, off-axis knee rotation and the curves of knee, hip and ankle:
    gait_report.json and gait_report.html.

    \b
      kinemimic gait --run runs/walk
    """
    report = gait(run)
    if as_json:
        click.echo(json.dumps(report, indent=2))
    else:
        Console(highlight=False, markup=False).print(table(report, run), soft_wrap=True)
