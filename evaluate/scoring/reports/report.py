"""report.html: the scores of an evaluation with the figures and tables behind them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from kinemimic.evaluate.scoring.metrics.capture_fit import Capture
from kinemimic.evaluate.scoring.metrics.gait_report import gait_report
from kinemimic.evaluate.scoring.metrics.gait_subjects import GaitSubject, captured, strike_phases
from kinemimic.evaluate.scoring.metrics.tracking_error import TRACKING_MEASURES
from kinemimic.evaluate.scoring.metrics.verdict import median, verdict
from kinemimic.evaluate.scoring.reports import figures
from kinemimic.evaluate.scoring.reports.capture_sections import capture_values
from kinemimic.evaluate.scoring.reports.cycle_figures import against_capture, mean_cycle
from kinemimic.evaluate.scoring.reports.first_screen import errors_before_fall, loop, shown_rollout, tiles
from kinemimic.evaluate.scoring.reports.gait_page import gait_values
from kinemimic.pipeline.cli.html import number, render
from kinemimic.pipeline.cli.picture import Draw
from kinemimic.pipeline.gait.curve_metrics import MEASURES, SCORED_JOINTS
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.pipeline.quality.stored import read_gimbal, read_quality
from kinemimic.retarget.formats.gait_json import report_of_run
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.rollout.trajectory import Trajectory
from kinemimic.train.sim.world import CONTROL_RATE

# "Fitting degree" over 500 frames and largest gap, as printed in the paper.
PAPER_FIT: Mapping[str, float] = {"knee": 0.914, "hip": 0.932}
PAPER_GAP_DEG: Mapping[str, float] = {"hip": 2.3}
LABELS: Mapping[str, tuple[str, int]] = {
    "r2": ("R²", 3),
    "r2_upright": ("R², upright", 3),
    "rmse_deg": ("RMSE,\u00a0°", 2),
    "max_gap_deg": ("largest gap,\u00a0°", 1),
    "nrmse_fit": ("1 − RMSE / range", 3),
    "cmc": ("CMC", 3),
    "r": ("correlation r", 3),
}
_STAGES: Mapping[str, str] = {
    "raw": "capture as read",
    "adjusted": "capture, pelvis and knees adjusted",
    "clean": "capture, adjusted and cleaned",
    "reference": "reference",
    "simulated": "simulated",
}
# The page has three colours.
LEVELS: Mapping[str, str] = {"good": "good", "fair": "partial", "poor": "bad", "falls": "bad"}
_SPREAD = ("min", "median", "max")
_SPREAD_MEASURES = ("r2", "r2_upright", "rmse_deg")
# Of `TRACKING_MEASURES`.
_TRACKING_LABELS = (
    "MPJPE, global,\u00a0mm",
    "MPJPE, root-relative,\u00a0mm",
    "E_vel,\u00a0mm/frame",
    "E_acc,\u00a0mm/frame²",
)


@dataclass(frozen=True)
class ReportInputs:
    """What a report shows of earlier stages, each None without its file: the JSON files of that name, and the
    captured person."""

    quality: Mapping[str, Any] | None
    gimbal: Mapping[str, Any] | None
    gait: Mapping[str, Any] | None
    captured: GaitSubject | None

    @classmethod
    def read(cls, run: Path, motion: Motion) -> ReportInputs:
        """Open and check all files, so that a damaged one is found before any rollout."""
        quality, gimbal = run / "quality.json", run / "gimbal.json"
        return cls(
            read_quality(quality) if quality.exists() else None,
            read_gimbal(gimbal) if gimbal.exists() else None,
            report_of_run(run, motion),
            captured(run, motion),
        )


@dataclass(frozen=True)
class ReportData:
    """The results that a report shows. scores: content of scores.json."""

    scores: Mapping[str, Any]
    trajectory: Trajectory
    no_policy: Trajectory
    motion: Motion
    capture: Capture | None


def report(inputs: ReportInputs, data: ReportData) -> str:
    """The page as HTML; without the sections whose input is None."""
    source = data.motion.provenance.get("capture", {}).get("source", "motion")
    name = Path(str(source)).name
    sections = capture_values(inputs.quality, inputs.gimbal, inputs.gait)
    gait = gait_report(inputs.captured, data.motion, data.trajectory)
    found_verdict = verdict(data.scores)
    # A loop whose strides could not be cut is drawn over time.
    by_cycle = data.motion.cyclic and any(one["curves"] for one in _strided(gait["subjects"]).values())
    return render(
        Path(__file__).with_name("templates") / "report.html",
        **gait_values(gait),
        **{**sections, "tables": _tables(data.scores) | sections["tables"]},
        title=f"kinemimic: {name}",
        name=name,
        scores=data.scores,
        alone=data.scores["no_policy"]["survival"],
        motion=data.motion,
        capture=data.capture,
        adjusted=adjusted(data.scores),
        rate=CONTROL_RATE,
        verdict_level=LEVELS[found_verdict.level],
        headline=found_verdict.headline,
        advice=found_verdict.advice,
        numbers=tiles(data.scores, data.trajectory),
        loop=loop(data.trajectory, data.motion),
        by_cycle=by_cycle,
        cycle_strides=_strides(gait["subjects"]),
        drawings=_drawings(data, gait["subjects"], by_cycle=by_cycle),
    )


def _strided(subjects: Mapping[str, Any]) -> dict[str, Any]:
    """Reference and simulation, as far as they have strides."""
    return {name: subjects[name] for name in ("reference", "simulated") if name in subjects}


def _strides(subjects: Mapping[str, Any]) -> str:
    """Whose strides the mean cycle is of; a humanoid that falls has few, or none."""
    if "simulated" not in subjects:
        return "the reference's strides; the humanoid completed none"
    left, right = (subjects["simulated"]["strides"][side] for side in SIDES)
    return f"all strides (the humanoid's: {left} left, {right} right)"


def made_from(scores: Mapping[str, Any]) -> str:
    """What the motion of scores.json was made from: walks, runs, or a pass as recorded."""
    return {"walk": "walks", "run": "runs"}.get(scores["motion"]["kind"], "pass")


def adjusted(scores: Mapping[str, Any]) -> list[str]:
    """Sentences about the adjustments of scores.json: what was done to the capture."""
    numbers = scores["capture"].get("adjustments")
    if not numbers:
        return []
    outside = ""
    if numbers["outside"]:
        outside = f"; {numbers['outside']:,} are outside of the {made_from(scores)} that it was made from"
    said = ["{used:,} of the {frames:,} frames of its passes are in the motion".format(**numbers) + outside]
    if numbers["pelvis_neutral"]:
        said.append(
            "the pelvis was replaced by a neutral one in {pelvis_neutral:,} of them".format(**numbers)
        )
    if numbers["hips_adjusted"] or numbers["knees_adjusted"]:
        said.append(
            "a neutral pelvis and projected knees change the hip in {hips_adjusted:,} and the knee in "
            "{knees_adjusted:,} of them".format(**numbers)
        )
    if numbers["strides_used"] is not None:
        used, found = numbers["strides_used"], numbers["strides_found"]
        share = number(used, 1) if found is None else f"{number(used, 1)} of {number(found, 1)}"
        said.append(f"{share} strides are used, each stretched in time to the motion's period")
    return said


def _by_side(measure: str, fits: Mapping[str, Any]) -> list[str]:
    """A measure's label and its values from phase 0, joint by joint and side by side."""
    label, digits = LABELS[measure]
    return [
        label,
        *(number(fits[joint][side][measure], digits) for joint in SCORED_JOINTS for side in SIDES),
    ]


def _medians(measure: str, *fits: Mapping[str, Any]) -> list[str]:
    """A measure's label and its medians over the start phases: of each joint, in each fit."""
    label, digits = LABELS[measure]
    values = [of["phases"][joint][measure]["median"] for joint in SCORED_JOINTS for of in fits]
    return [label, *(number(value, digits) for value in values)]


def _tables(scores: Mapping[str, Any]) -> dict[str, Any]:
    fit, no_policy = scores["fit"], scores["no_policy"]["fit"]
    rows = [_medians(measure, fit, no_policy) for measure in MEASURES]
    degrees = [cell for joint in SCORED_JOINTS for cell in (f"{100 * PAPER_FIT[joint]:.1f} %", "–")]
    gaps = [cell for joint in SCORED_JOINTS for cell in (number(PAPER_GAP_DEG.get(joint), 1), "–")]
    rows += [["paper: “fitting degree”", *degrees], ["paper: largest gap,\u00a0°", *gaps]]
    spread = [
        [
            LABELS[m][0],
            *(number(fit["phases"][j][m][s], LABELS[m][1]) for j in SCORED_JOINTS for s in _SPREAD),
        ]
        for m in _SPREAD_MEASURES
    ]
    capture, truth = scores["fit_capture"], scores["truth"]
    runs = [of["tracking"]["phases"] for of in (scores, scores["no_policy"])]
    errors = [
        [
            label,
            *(
                number(median((run[part] or {}).get(name)), 1)
                for run in runs
                for part in ("all", "successful")
            ),
        ]
        for name, label in zip(TRACKING_MEASURES, _TRACKING_LABELS, strict=True)
    ]
    return {
        "tracking": errors,
        "scores": rows,
        "sides": [f"{joint} {side}" for joint in SCORED_JOINTS for side in SIDES],
        "by_side": [_by_side(measure, fit) for measure in MEASURES],
        "spread": [f"{joint} {one}" for joint in SCORED_JOINTS for one in _SPREAD],
        "phases": spread,
        "capture": None
        if capture is None
        else [_medians(measure, capture, capture["all_frames"], capture["adjusted"]) for measure in MEASURES],
        "truth": None
        if truth is None
        else [
            [
                label,
                *(
                    number(truth[key][j][m], d)
                    for j in SCORED_JOINTS
                    for m, d in (("rmse_deg", 2), ("r2", 3))
                ),
            ]
            for key, label in _STAGES.items()
        ],
    }


def _drawings(data: ReportData, subjects: Mapping[str, Any], *, by_cycle: bool) -> dict[str, Draw | None]:
    """Figures by name; first: the one of the first screen."""
    trajectory, no_policy = data.trajectory, data.no_policy
    frames, cyclic = data.scores["fit"]["frames"], data.motion.cyclic
    rows = errors_before_fall(trajectory, frames)[1:]
    errors = {joint: [np.nan if (e := row[joint]) is None else e for row in rows] for joint in SCORED_JOINTS}
    strides = _strided(subjects)
    return {
        "first": mean_cycle(strides, normal=any(one["kind"] == "walk" for one in strides.values()))
        if by_cycle
        else figures.both_sides(trajectory, shown_rollout(trajectory)),
        "curves": figures.curves(trajectory, no_policy, frames),
        "cycles": None
        if data.capture is None
        else against_capture(
            trajectory,
            data.capture.of_used(),
            frames,
            cyclic=cyclic,
            strikes=strike_phases(data.motion) if cyclic else None,
        ),
        "start_phases": figures.start_phases(trajectory, no_policy, errors),
        "root_path": figures.root_path(trajectory),
        "reward_terms": figures.reward_terms(trajectory),
        "torques": figures.torques(data.scores["torque"]["joints"]),
    }
