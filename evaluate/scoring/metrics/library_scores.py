"""Scores of a tracker on every motion of a library, and their summary by split and kind."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from kinemimic.evaluate.scoring.metrics.scores import fit, root_path, survival
from kinemimic.evaluate.scoring.metrics.tracking_error import TRACKING_MEASURES, tracking
from kinemimic.pipeline.gait.curve_metrics import SCORED_JOINTS
from kinemimic.pipeline.parallel.task_pool import parallel_map
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.library.motion_library import Entry, MotionLibrary
from kinemimic.train.config.env_config import EnvConfig
from kinemimic.train.rollout.evaluation import episode_frames, reported_phases
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.rollout.rollout import collect_here
from kinemimic.train.rollout.trajectory import Trajectory

_DIGITS = 4


def motion_scores(entry: Entry, trajectory: Trajectory, duration: float) -> dict[str, Any]:
    """Scores of the rollouts on one motion of this duration (s): a row of tracker_scores.json.

    frames: before a fall, median over the start phases; of: frames of a rollout; phases: number of start
    phases without a fall; phases_of: number of start phases; succeeded: number of start phases from which
    the joints stay within 0.5 m of their reference on average; succeeded_first: whether phase 0 is one of
    them. The errors of `tracking_error.py`, R² of knee and hip without credit after a fall, and the speed
    relative to the reference are medians over the start phases, None if undefined.
    """
    survived, errors = survival(trajectory), tracking(trajectory)
    fits = fit(trajectory, trajectory.root.shape[1])["phases"]
    speed = root_path(trajectory, duration)["phases"]["speed_ratio"]
    spreads = errors["phases"]["all"]
    return {
        "name": entry.name,
        "subject": entry.subject,
        "split": entry.split,
        "kind": entry.kind,
        "cyclic": entry.cyclic,
        "frames": survived["frames_median"],
        "of": survived["of"],
        "phases": survived["phases"],
        "phases_of": survived["phases_of"],
        "succeeded": errors["phases"]["succeeded"],
        "succeeded_first": errors["succeeded"],
        **{name: _median(spreads[name]) for name in TRACKING_MEASURES},
        **{f"r2_{joint}": _median(fits[joint]["r2_upright"]) for joint in SCORED_JOINTS},
        "speed_ratio": _median(speed),
    }


def _median(spread: dict[str, float] | None) -> float | None:
    return None if spread is None else round(float(spread["median"]), _DIGITS)


def summaries(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """One row for each split and kind: number of motions, shares and medians over them.

    succeeded: share of the motions that succeed from phase 0, as papers count; succeeded_phases: share of all
    rollouts; whole: share of the motions without a fall from any start phase; frames: mean share before
    the fall; measures: medians.
    """
    found = []
    for split, kind in sorted({(row["split"], row["kind"]) for row in rows}):
        own = [row for row in rows if (row["split"], row["kind"]) == (split, kind)]
        total = sum(row["phases_of"] for row in own)
        measures = {}
        for name in (*TRACKING_MEASURES, "r2_knee", "r2_hip", "speed_ratio"):
            values = [row[name] for row in own if row[name] is not None]
            measures[name] = round(float(np.median(values)), _DIGITS) if values else None
        found.append(
            {
                "split": split,
                "kind": kind,
                "motions": len(own),
                "succeeded": round(sum(row["succeeded_first"] for row in own) / len(own), _DIGITS),
                "succeeded_phases": round(sum(row["succeeded"] for row in own) / total, _DIGITS),
                "whole": round(sum(row["phases"] == row["phases_of"] for row in own) / len(own), _DIGITS),
                "frames": round(float(np.mean([row["frames"] / row["of"] for row in own])), _DIGITS),
                **measures,
            }
        )
    return found


def score_library(
    library: MotionLibrary,
    indices: Sequence[int],
    policy: Policy,
    config: EnvConfig,
    *,
    engine: str,
    workers: int | None = None,
    progress: Callable[[int], object] | None = None,
) -> list[dict[str, Any]]:
    """`motion_scores` of these motions of a library; progress: called with the number of finished motions."""
    tasks = [(library.entries[k], library.motion(k), policy, config, engine) for k in indices]
    return parallel_map(_score, tasks, workers=workers, progress=progress)


def _score(task: tuple[Entry, Motion, Policy, EnvConfig, str]) -> dict[str, Any]:
    entry, motion, policy, config, engine = task
    trajectory = collect_here(
        motion,
        policy,
        config,
        start_phases=np.array(reported_phases(motion)),
        frames=episode_frames(motion),
        engine=engine,
    )
    return motion_scores(entry, trajectory, motion.duration)
