"""What `train` says at its end: whether the policy walks or falls, and what to do next."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from kinemimic.pipeline.cli.progress_state import minutes
from kinemimic.pipeline.plural import plural
from kinemimic.pipeline.run_folder.capture import run_flag
from kinemimic.retarget.formats.gait_json import report_of_run
from kinemimic.train.config.training import Training
from kinemimic.train.rollout.evaluation import Evaluation
from kinemimic.train.rollout.policy import POLICY, training_summary
from kinemimic.train.rollout.verdict import Outcome, Verdict, judge


def training_verdict(
    record: Mapping[str, Any], gait: Mapping[str, Any] | None = None, where: str = ""
) -> Verdict:
    """The verdict on the best evaluation of a training run, from the content of policy.json and gait.json.

    An evaluation measures no path, and has fewer phases than `evaluate`. where: as for `judge`.
    """
    kept, gait = Evaluation(**record["best"]), gait or {}
    phases = kept.episodes or 1
    upright = int(kept.frames == kept.of) if kept.completed is None else kept.completed
    return judge(
        Outcome(
            frames=kept.of,
            phases=phases,
            upright=upright,
            first=kept.frames,
            cyclic=gait.get("cyclic", len(record["evaluated_with"]["start_phases"]) > 1),
            kind=gait.get("kind", ""),
            fits={"knee": (kept.knee, None), "hip": (kept.hip, None)},
            findings=tuple(finding["message"] for finding in gait.get("gate", ())),
        ),
        Training.of(training_summary(record)),
        where,
    )


def closing_words(record: Mapping[str, Any], run: Path) -> Iterator[str]:
    """The lines at the end of training in a run folder; record: content of policy.json."""
    gait, where = report_of_run(run), run_flag(run)
    found, kept = training_verdict(record, gait, where), Evaluation(**record["best"])
    yield found.headline
    yield (
        f"best of {plural(len(record['evaluations']), 'evaluation')}, after {kept.samples:,} samples: "
        f"R² {kept.knee:.3f} knee, {kept.hip:.3f} hip, {100 * kept.reward:.1f} % of the reward"
        + (
            ""
            if kept.robust_return is None
            else f", {100 * kept.robust_return:.1f} % with domain randomization"
        )
    )
    if found.level == "good":
        others = "other phases" if len(record["evaluated_with"]["start_phases"]) > 1 else "its beginning"
        yield f"`kinemimic evaluate{where}` scores it from {others}."
    else:
        yield found.advice
    if record["exploded"]:
        yield f"{record['exploded']:,} humanoids exploded in the simulation and were reset"
    rate = record["samples"] / max(record["seconds"], 1e-9)
    yield (
        f"{run / POLICY}: {record['samples']:,} samples in {minutes(record['seconds'])} ({rate:,.0f}/s), "
        f"preset {record['preset']}, seed {record['seed']}, {record['engine']} engine" + mirroring(record)
    )


def mirroring(record: Mapping[str, Any]) -> str:
    """What the policy mirrors: half a cycle of a gait; in a tracker, which knows no cycle, the sides."""
    if not record["mirrored"]:
        return ""
    tracks = record["config"]["env"].get("tracking") is not None
    return ", left and right mirrored" if tracks else ", the second half of the cycle mirrors the first"
