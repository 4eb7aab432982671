"""`kinemimic evaluate`: the policy performs; scores.json, curves.csv, report.html, trajectory.npz say how."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click
import numpy as np
from rich.console import Console, Group, RenderableType
from rich.table import Table
from rich.text import Text

from kinemimic.evaluate.policies.shipped import run_options
from kinemimic.evaluate.scoring.capture_fit import read_capture
from kinemimic.evaluate.scoring.report import LABELS, PAPER_FIT, PAPER_GAP_DEG, ReportData, report
from kinemimic.evaluate.scoring.scores import compose
from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.cli.html import number
from kinemimic.pipeline.cli.options import json_option
from kinemimic.pipeline.cli.progress import progress
from kinemimic.pipeline.files.provenance import provenance
from kinemimic.pipeline.files.store import file_hash, write_json, write_text
from kinemimic.pipeline.gait.curve_metrics import MEASURES, SCORED_JOINTS
from kinemimic.retarget.humanoid.motion import Motion, joint_angles
from kinemimic.train.rollout.evaluation import frames_of
from kinemimic.train.rollout.policy import POLICY, learnt
from kinemimic.train.rollout.rollout import collect_trajectories
from kinemimic.train.rollout.trajectory import Trajectory
from kinemimic.train.sim.engines import resolve
from kinemimic.train.sim.options import engine_option, workers_option
from kinemimic.train.sim.world import CONTROL_RATE

START_PHASES = 13


def protocol(motion: Motion) -> tuple[Array, int]:
    """Start phases (S,) and frames of an evaluation: 13 and 20 s of a walk, a single performance once."""
    starts = np.arange(START_PHASES) / START_PHASES if motion.cyclic else np.zeros(1)
    return starts, frames_of(motion)


def evaluate(run: Path, *, workers: int | None = None, engine: str = "auto") -> dict[str, Any]:
    """Score run/policy.safetensors on run/motion.json; returns the content of scores.json.

    Nothing is written before everything is known. workers: processes that simulate, all cores by default;
    engine: of `train/engines.py`.
    """
    engine = resolve(engine)
    motion, _, record = learnt(run)
    policy = run / POLICY
    capture = read_capture(run / "capture.parquet")
    phases, frames = protocol(motion)
    with progress("evaluate", 2 * len(phases)) as bar:
        trajectory, no_policy = (
            collect_trajectories(
                motion,
                who,
                start_phases=phases,
                frames=frames,
                engine=engine,
                workers=workers,
                progress=bar.advance,
            )
            for who in (policy, None)
        )
    scores = compose(
        trajectory,
        no_policy,
        motion,
        capture=capture,
        policy=record,
        provenance=provenance(
            "evaluate",
            inputs={
                "motion": motion.identity,
                "policy": file_hash(policy),
            },
            config={"frames": frames, "start_phases": len(phases), "engine": engine},
            seed=record.get("seed"),
        ),
    )
    html = report(run, ReportData(scores, trajectory, no_policy, motion, capture))
    trajectory.save(run / "trajectory.npz")
    write_text(run / "curves.csv", curves_csv(trajectory, no_policy))
    write_text(run / "report.html", html)
    # Last, because it is what says that the evaluation is complete.
    write_json(run / "scores.json", scores)
    return scores


def curves_csv(trajectory: Trajectory, no_policy: Trajectory) -> str:
    """Knee and hip in degrees from phase 0, one line a frame: reference, simulated, no policy."""
    columns = {
        f"{who}_{name}_deg": np.degrees(values)
        for who, rotations in (
            ("reference", trajectory.reference_rotations),
            ("simulated", trajectory.rotations),
            ("no_policy", no_policy.rotations),
        )
        for name, values in joint_angles(rotations[0]).items()
    }
    lines = [",".join(["frame", "time_s", *columns])]
    for frame, row in enumerate(np.stack(list(columns.values()), axis=1)):
        lines.append(
            ",".join([f"{frame}", f"{(frame + 1) / CONTROL_RATE:.4f}", *(f"{value:.3f}" for value in row)])
        )
    return "\n".join(lines) + "\n"


def table(scores: dict[str, Any], run: Path) -> RenderableType:
    """The scores for a terminal."""
    fit, nothing = scores["fit"], scores["no_policy"]["fit"]
    survived, alone, root = scores["survival"], scores["no_policy"]["survival"], scores["root"]
    grid = Table("", header_style="bold", box=None, pad_edge=False)
    for column in ("knee", "no policy", "paper", "hip", "no policy", "paper"):
        grid.add_column(column, justify="right", style=None if column in SCORED_JOINTS else "dim")
    for measure in MEASURES:
        label, digits = LABELS[measure]
        cells: list[str] = []
        for joint in SCORED_JOINTS:
            paper = number(PAPER_GAP_DEG.get(joint), 1) if measure == "max_gap_deg" else "–"
            cells += [number(of[joint][measure], digits) for of in (fit, nothing)] + [paper]
        grid.add_row(label, *cells)
    grid.add_row("fitting degree (*)", "", "", f"{PAPER_FIT['knee']:.3f}", "", "", f"{PAPER_FIT['hip']:.3f}")
    lines = [
        f"survives {survived['frames']} of {survived['of']} frames from phase 0, all of them from "
        f"{survived['phases']} of {survived['phases_of']} start phases (no policy: {alone['frames']} frames)",
        f"advance over the reference's {number(root['speed_ratio'], 3)}, {number(root['path_error_m'], 2)} "
        f"m off at the end; largest torque {scores['torque']['peak']:.0f} N·m ({scores['torque']['joint']})",
    ]
    below = ["(*) the paper publishes no formula for it"]
    if scores["capture"]["simulated"]:
        lines.insert(0, "SIMULATED CAPTURE (virtual Kinect)")
    if scores["fit_capture"] is not None:
        of = scores["fit_capture"]
        below.append(
            f"against the unfiltered capture: R² {number(of['knee']['r2'], 3)} knee, "
            f"{number(of['hip']['r2'], 3)} hip"
        )
    if scores["truth"] is not None:
        below += [
            f"RMSE against the truth, {joint}: "
            + ", ".join(f"{who} {number(of[joint]['rmse_deg'], 2)}°" for who, of in scores["truth"].items())
            for joint in SCORED_JOINTS
        ]
    below.append(f"report: {run / 'report.html'}")
    return Group(
        *(Text(line) for line in lines),
        grid,
        *(Text(line) for line in below),
    )


@click.command("evaluate")
@run_options()
@workers_option
@engine_option
@json_option("Print scores.json.")
def command(run: Path, workers: int | None, engine: str, as_json: bool) -> None:
    """Let the run's policy, or one that ships, perform; score it against reference, capture and truth.

    \b
      kinemimic evaluate --run runs/walk
      kinemimic evaluate --policy walk
    """
    scores = evaluate(run, workers=workers, engine=engine)
    if as_json:
        click.echo(json.dumps(scores, indent=2))
    else:
        # A path that is broken over two lines cannot be opened.
        Console(highlight=False).print(table(scores, run), soft_wrap=True)
