"""The scores as a few lines of Markdown, shown beside the animation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from kinemimic.pipeline.gait.curve_metrics import SCORED_JOINTS
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.rollout.trajectory import Trajectory
from kinemimic.train.scenario.scenario import Scenario
from kinemimic.train.sim.world import CONTROL_RATE

_ROWS = (
    ("R²", "fit.{}.r2", "{:.3f}"),
    ("R², upright", "fit.{}.r2_upright", "{:.3f}"),
    ("… with no policy", "no_policy.fit.{}.r2_upright", "{:.3f}"),
    ("RMSE", "fit.{}.rmse_deg", "{:.1f}°"),
    ("largest gap", "fit.{}.max_gap_deg", "{:.1f}°"),
    ("R², capture as read", "fit_capture.{}.r2", "{:.3f}"),
)


def trial_caption(motion: Motion, trajectory: Trajectory, scenario: Scenario, number: int) -> str:
    """Markdown about one trial of a scenario."""
    text = f"Scenario **{scenario.name}**, trial {number}: {scenario.about}"
    return "\n".join([*_survival(motion, trajectory, 0), "", text])


def _survival(motion: Motion, trajectory: Trajectory, rollout: int) -> list[str]:
    lines = ["**Simulated capture (virtual Kinect)**", ""] if motion.simulated else []
    frames, fallen = trajectory.root.shape[1], int(trajectory.fallen_at[rollout])
    walked = f"**{min(fallen, frames)} of {frames} frames** without a fall"
    return [*lines, walked if fallen >= frames else f"{walked}; fell at {(fallen + 1) / CONTROL_RATE:.1f} s"]


def caption(
    motion: Motion,
    trajectory: Trajectory,
    rollout: int,
    scores: Mapping[str, Any] | None,
    capture: str | None = None,
) -> str:
    """Markdown about one rollout, with the scores (content of scores.json) if there are any.

    capture: a line about the captured skeleton.
    """
    lines = _survival(motion, trajectory, rollout)
    if scores is None:
        lines += ["", "No scores yet: run `kinemimic evaluate` to write scores.json."]
    else:
        lines += _scored(scores)
    return "\n".join(lines if capture is None else [*lines, "", capture])


def _scored(scores: Mapping[str, Any]) -> list[str]:
    lines = ["", "| | " + " | ".join(SCORED_JOINTS) + " |", "|---|" + "---|" * len(SCORED_JOINTS)]
    for label, path, form in _ROWS:
        cells = (_shown(scores, path.format(joint), form) for joint in SCORED_JOINTS)
        lines.append(f"| {label} | " + " | ".join(cells) + " |")
    lines += [
        "",
        f"- no fall from {_shown(scores, 'survival.phases')} of "
        f"{_shown(scores, 'survival.phases_of')} start phases",
        f"- speed: {_shown(scores, 'root.speed_ratio', '{:.3f}')} of the reference's, "
        f"path error {_shown(scores, 'root.path_error_m', '{:.2f}')} m at the end",
        f"- peak torque about one axis: {_shown(scores, 'torque.peak', '{:.0f}')} N·m",
        f"- trained on {_shown(scores, 'train.samples', '{:,}')} samples"
        + ("" if scores.get("train", {}).get("finished") is not False else " so far: training unfinished"),
    ]
    return lines


def _shown(scores: Any, path: str, form: str = "{}") -> str:
    """A number at a dotted path; a dash if it is missing."""
    for key in path.split("."):
        if not isinstance(scores, Mapping) or scores.get(key) is None:
            return "–"
        scores = scores[key]
    return form.format(scores)
