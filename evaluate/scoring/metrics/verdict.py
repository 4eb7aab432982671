"""The verdict on a policy, from the content of scores.json: the first line of every summary."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from kinemimic.pipeline.gait.curve_metrics import SCORED_JOINTS
from kinemimic.train.config.training import Training
from kinemimic.train.rollout.verdict import Outcome, Verdict, judge


def verdict(scores: Mapping[str, Any], where: str = "") -> Verdict:
    """The verdict on the rollouts of scores.json; also of an earlier version, which knew less.

    where: as for `judge`.
    """
    survived, root = scores["survival"], scores["root"]
    fit, motion = scores["fit"]["phases"], scores.get("motion", {})
    return judge(
        Outcome(
            frames=survived["of"],
            phases=survived["phases_of"],
            upright=survived["phases"],
            typical=survived["frames_median"],
            first=survived.get("frames_min"),
            # Only a motion that is performed once has a single start phase.
            cyclic=motion.get("cyclic", survived["phases_of"] > 1),
            kind=motion.get("kind", ""),
            fits={
                joint: (median(fit[joint]["r2_upright"]), median(fit[joint]["rmse_deg"]))
                for joint in SCORED_JOINTS
            },
            speed_ratio=median(root["phases"]["speed_ratio"]),
            path_error_m=median(root["phases"]["path_error_m"]),
            # Earlier versions wrote no path; their references went straight.
            path_m=root.get("reference_path_m", root["reference_advance_m"]),
            findings=tuple(motion.get("findings", ())),
            refused=motion.get("refused", False),
        ),
        Training.of(scores["train"]),
        where,
    )


def median(spread: Mapping[str, float | None] | None) -> float | None:
    """The median of a spread over start phases; None where the value is undefined."""
    return None if spread is None else spread["median"]
