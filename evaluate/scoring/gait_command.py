"""`kinemimic gait`: gait metrics of capture, reference and simulation, side by side."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click
import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from kinemimic.evaluate.policies.unfinished import say, unfinished_rollouts
from kinemimic.evaluate.scoring.metrics.gait_report import gait_report
from kinemimic.evaluate.scoring.metrics.gait_subjects import GaitSubject, captured
from kinemimic.evaluate.scoring.reports.gait_page import NO_VALUE, ROWS, gait_page, notes
from kinemimic.evaluate.scoring.reports.index_page import write_index
from kinemimic.pipeline.cli.options import json_option, run_option
from kinemimic.pipeline.cli.terminal import show
from kinemimic.pipeline.convert import on_nodes, read_converted
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.provenance import provenance
from kinemimic.pipeline.files.stages import stage_named
from kinemimic.pipeline.files.store import file_hash, write_json, write_text
from kinemimic.pipeline.kinematics.nodes import shows_feet
from kinemimic.pipeline.locomotion.no_walk import why_no_walk
from kinemimic.pipeline.run_folder.stage import stage
from kinemimic.retarget.formats.motion_json import read_motion_json
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.rollout.trajectory import Trajectory

# At least one of these is needed: a trajectory alone lacks the motion's body.
SUBJECTS = ("quaternions.parquet", "motion.json")
FILES = stage_named("gait").reads


def gait(run: Path) -> dict[str, Any]:
    """Write gait_report.json and gait_report.html of a run folder; returns the content of the former.

    KinemimicError if there is no subject, or none with a full stride.
    """
    if not run.is_dir():
        raise KinemimicError(f"{run}: expected a run folder, found none; choose one with --run")
    if not any((run / name).exists() for name in SUBJECTS):
        raise KinemimicError(
            f"{run}: expected {' or '.join(SUBJECTS)}, found neither; run `ingest` and `convert` first"
        )
    with stage(run, "gait") as out:
        return _gait(run, out)


def _gait(run: Path, out: Path) -> dict[str, Any]:
    motion = read_motion_json(run / "motion.json") if (run / "motion.json").exists() else None
    trajectory = (
        Trajectory.load(run / "trajectory.npz", motion)
        if motion and (run / "trajectory.npz").exists()
        else None
    )
    capture = captured(run, motion)
    report = gait_report(capture, motion, trajectory)
    if not report["subjects"]:
        raise KinemimicError(
            f"{run}: expected a gait with at least one full stride, found none in capture, reference or "
            f"simulation{_recorded(run, capture)}; record two or more strides of walking or running"
        )
    # The report names its person after the recording, and says whether a camera was there.
    report["recording"], report["simulated"] = _recording(run, motion)
    report["provenance"] = provenance(
        "gait", inputs={name: file_hash(run / name) for name in FILES if (run / name).exists()}, config={}
    )
    page = gait_page(run.resolve().name, report)
    write_text(out / "gait_report.html", page)
    write_json(out / "gait_report.json", report)
    return report


def _recording(run: Path, motion: Motion | None) -> tuple[str | None, bool]:
    """Name of the recording, if known, and whether it is simulated."""
    if motion is not None:
        found, simulated = motion.provenance.get("capture", {}), motion.simulated
    else:
        clip = read_converted(run)
        found, simulated = clip.provenance, clip.simulated
    source = found.get("source")
    return (Path(str(source)).name if source else None), simulated


def _recorded(run: Path, capture: GaitSubject | None) -> str:
    """Duration and foot strikes of a capture without a full stride, or why its strides are not a walk."""
    if capture is None:
        return ""
    if not capture.gait.bouts:
        clip = on_nodes(read_converted(run))
        if found := why_no_walk(clip.times, clip.passes, clip.positions, toes=shows_feet(clip.states)):
            return f"; the capture has {found}"
    seconds = sum(
        float(np.ptp(capture.times[capture.passes == k])) for k in set(capture.passes[capture.passes >= 0])
    )
    strikes = [sum(len(feet.strikes[k]) for feet in capture.gait.feet.values()) for k in range(2)]
    return (
        f"; the capture's {seconds:.1f} s contain {strikes[0]} left and {strikes[1]} right foot strikes, and "
        "a stride needs two of the same foot"
    )


def table(report: Mapping[str, Any], run: Path) -> RenderableType:
    """The report for a terminal."""
    subjects = report["subjects"]
    grid = Table("", header_style="bold", box=None, pad_edge=False)
    for name in subjects:
        grid.add_column(name, justify="right")
    for row in ROWS:
        cells = [row.cell(subject) for subject in subjects.values()]
        if any(text != NO_VALUE for text in cells):
            label = f"{row.name} [{row.unit}]" if row.unit else row.name
            grid.add_row(label, *cells)
    lines = [
        *notes(report),
        *(f"{name}: {source}" for name, source in report["normative"].items()),
        f"curves: {run / 'gait_report.html'}",
    ]
    return Group(grid, *(Text(line) for line in lines))


@click.command("gait")
@run_option()
@json_option("Print gait_report.json.")
def command(run: Path, as_json: bool) -> None:
    """Compute gait metrics of a run's capture, reference and simulation, and compare them with normal gait.

    Writes gait_report.json and gait_report.html with cadence, lengths, speed, stance, symmetry, off-axis knee
    rotation and the curves of knee, hip and ankle. What has no full stride is listed without metrics.

    \b
      kinemimic gait --run runs/walk
    """
    report = gait(run)
    write_index(run)
    if "simulated" in report["subjects"]:
        say(unfinished_rollouts(run))
    if as_json:
        click.echo(json.dumps(report, indent=2))
    else:
        show(table(report, run), wrap=False)
