"""Score a policy by rolling it out; write scores.json, curves.csv, report.html, trajectory.npz."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from kinemimic.evaluate.scoring.metrics.capture_fit import read_capture
from kinemimic.evaluate.scoring.metrics.scores import compose
from kinemimic.evaluate.scoring.metrics.tracking_error import FAILURE_DISTANCE, TRACKING_MEASURES
from kinemimic.evaluate.scoring.metrics.verdict import median, verdict
from kinemimic.evaluate.scoring.reports.report import (
    LABELS,
    PAPER_FIT,
    PAPER_GAP_DEG,
    ReportData,
    ReportInputs,
    adjusted,
    made_from,
    report,
)
from kinemimic.pipeline.cli.html import number
from kinemimic.pipeline.cli.progress import progress
from kinemimic.pipeline.files.provenance import provenance
from kinemimic.pipeline.files.store import file_hash, write_json, write_text
from kinemimic.pipeline.gait.curve_metrics import MEASURES, SCORED_JOINTS
from kinemimic.pipeline.plural import plural
from kinemimic.pipeline.run_folder.capture import run_flag
from kinemimic.pipeline.run_folder.stage import stage
from kinemimic.retarget.humanoid.motion import joint_angles
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.rollout.evaluation import episode_frames, reported_phases
from kinemimic.train.rollout.policy import POLICY, load_trained
from kinemimic.train.rollout.rollout import collect_trajectories
from kinemimic.train.rollout.trajectory import Trajectory
from kinemimic.train.rollout.verdict import Level
from kinemimic.train.sim.engines import resolve
from kinemimic.train.sim.world import CONTROL_RATE

# Of the verdict in a terminal.
STYLES: Mapping[Level, str] = {
    "good": "bold green",
    "fair": "bold yellow",
    "poor": "bold red",
    "falls": "bold red",
}


def evaluate(run: Path, *, workers: int | None = None, engine: str = "auto") -> dict[str, Any]:
    """Score run/policy.safetensors on run/motion.json; returns the content of scores.json.

    Files are written only after everything has succeeded. workers: simulation processes, by default one per
    core; engine: see `train/sim/engines.py`.
    """
    with stage(run, "evaluate") as out:
        return _evaluate(run, out, workers=workers, engine=resolve(engine))


def _evaluate(run: Path, out: Path, *, workers: int | None, engine: str) -> dict[str, Any]:
    motion, actor, record = load_trained(run)
    policy = run / POLICY
    config = TrainConfig.from_json(record["config"], policy.with_suffix(".json"), ("config",))
    capture = read_capture(run / "capture.parquet", motion)
    inputs = ReportInputs.read(run, motion)
    phases, frames = np.array(reported_phases(motion)), episode_frames(motion)
    with progress("evaluate", 2 * len(phases), unit="rollouts") as bar:
        trajectory, no_policy = (
            collect_trajectories(
                motion,
                who,
                config.measured_env,
                start_phases=phases,
                frames=frames,
                engine=engine,
                workers=workers,
                progress=bar.advance,
            )
            for who in (actor, None)
        )
    scores = compose(
        trajectory,
        no_policy,
        motion,
        capture=capture,
        gait=inputs.gait,
        reward=config.final_reward,
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
    html = report(inputs, ReportData(scores, trajectory, no_policy, motion, capture))
    trajectory.save(out / "trajectory.npz")
    write_text(out / "curves.csv", curves_csv(trajectory, no_policy))
    write_text(out / "report.html", html)
    write_json(out / "scores.json", scores)
    return scores


def curves_csv(trajectory: Trajectory, no_policy: Trajectory) -> str:
    """Knee and hip angles in degrees from phase 0, one line per frame: reference, simulated, no policy."""
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
    """The scores as text for a terminal: the verdict, then medians over the start phases."""
    found = verdict(scores, run_flag(run))
    return Group(
        Text(found.headline, style=STYLES[found.level]),
        Text(found.advice),
        *(Text(line) for line in _summary(scores)),
        _fit_grid(scores),
        Text("(*) the paper gives no formula"),
        *(Text(line) for line in _comparisons(scores)),
        Text(f"report: {run / 'report.html'}"),
    )


def _summary(scores: dict[str, Any]) -> list[str]:
    """Survival, speed, path, torques and errors of all joints, in lines."""
    survived, alone = scores["survival"], scores["no_policy"]["survival"]
    root, torque = scores["root"]["phases"], scores["torque"]
    lines = ["SIMULATED CAPTURE (virtual Kinect)"] if scores["capture"]["simulated"] else []
    lines += [
        f"{_over(survived['phases_of'])}: upright for {survived['frames_median']:.0f} of "
        f"{survived['of']} frames (no policy: {alone['frames_median']:.0f}), no fall from "
        f"{survived['phases']} of {plural(survived['phases_of'], 'phase')} (no policy: {alone['phases']})",
        f"speed relative to the reference {number(median(root['speed_ratio']), 3)}, final distance "
        f"{number(median(root['path_error_m']), 2)} m; largest torque about one axis "
        f"{number(torque['peak'], 0)} of {number(torque['limit'], 0)} N·m ({torque['joint']})",
        tracking_line(scores["tracking"]),
    ]
    return lines


def _fit_grid(scores: dict[str, Any]) -> Table:
    """The fit of knee and hip, with and without the policy, and in the paper."""
    fit, nothing = scores["fit"]["phases"], scores["no_policy"]["fit"]["phases"]
    grid = Table("", header_style="bold", box=None, pad_edge=False)
    for column in ("knee", "no policy", "paper", "hip", "no policy", "paper"):
        grid.add_column(column, justify="right", style=None if column in SCORED_JOINTS else "dim")
    for measure in MEASURES:
        label, digits = LABELS[measure]
        cells: list[str] = []
        for joint in SCORED_JOINTS:
            paper = number(PAPER_GAP_DEG.get(joint), 1) if measure == "max_gap_deg" else "–"
            cells += [number(of[joint][measure]["median"], digits) for of in (fit, nothing)] + [paper]
        grid.add_row(label, *cells)
    grid.add_row("fitting degree (*)", "", "", f"{PAPER_FIT['knee']:.3f}", "", "", f"{PAPER_FIT['hip']:.3f}")
    return grid


def _comparisons(scores: dict[str, Any]) -> list[str]:
    """The fit against the capture and against the true motion, where they are known, in lines."""
    lines: list[str] = []
    if scores["fit_capture"] is not None:
        of = scores["fit_capture"]
        for part, what in (
            (of, "the motion's frames as read"),
            (of["all_frames"], f"all frames of its {made_from(scores)} as read"),
            (of["adjusted"], "the motion's frames, pelvis and knees adjusted"),
        ):
            r2 = [number(part["phases"][joint]["r2_upright"]["median"], 3) for joint in SCORED_JOINTS]
            lines.append(f"R², upright, against {what} ({part['frames']:,}): {r2[0]} knee, {r2[1]} hip")
        lines += adjusted(scores)
    if scores["truth"] is not None:
        lines += [
            f"RMSE from the true motion, {joint}: "
            + ", ".join(f"{who} {number(of[joint]['rmse_deg'], 2)}°" for who, of in scores["truth"].items())
            for joint in SCORED_JOINTS
        ]
    return lines


def _over(phases: int) -> str:
    return "from the only start phase" if phases == 1 else f"medians over {phases} start phases"


def tracking_line(tracking: Mapping[str, Any]) -> str:
    """Success and errors of all joints, as one line of text."""
    phases = tracking["phases"]
    medians = [median(phases["all"][name]) for name in TRACKING_MEASURES]
    overall, local, velocity, acceleration = (number(value, 1) for value in medians)
    return (
        f"all joints within {FAILURE_DISTANCE} m on average from {phases['succeeded']} of "
        f"{plural(phases['of'], 'phase')}; "
        f"MPJPE {overall} mm, root-relative {local} mm; E_vel {velocity} mm/frame, "
        f"E_acc {acceleration} mm/frame²"
    )
