"""`kinemimic datasets score`: evaluates a shipped policy again and compares the scores with those on record.

Metrics within their tolerance are written as recorded, so that every machine writes the same file; otherwise
the command fails.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import click

from kinemimic.evaluate.policies.recipe import POLICIES
from kinemimic.evaluate.policies.scores_file import read_scores
from kinemimic.evaluate.policies.shipped import SCORES, ShippedPolicies
from kinemimic.evaluate.scoring.evaluate import evaluate
from kinemimic.pipeline.cli.options import json_option
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import write_json
from kinemimic.pipeline.gait.curve_metrics import SCORED_JOINTS
from kinemimic.retarget.versions.params import Params, params_option
from kinemimic.train.sim.options import engine_option, workers_option

SCHEMA = 1
Metrics = Mapping[str, float | None]


def metrics(scores: Mapping[str, Any]) -> dict[str, float | None]:
    """The compared metrics of scores.json: survival, fit and path; None if undefined."""
    fit = {
        f"{joint}_{metric}": scores["fit"][joint][metric]
        for joint in SCORED_JOINTS
        for metric in ("r2", "rmse_deg", "max_gap_deg")
    }
    root = {name: scores["root"][name] for name in ("speed_ratio", "path_error_m")}
    return {"frames": scores["survival"]["frames"], "phases": scores["survival"]["phases"], **fit, **root}


def confirmed(
    recorded: Metrics, found: Metrics, tolerances: Mapping[str, float], name: str
) -> dict[str, float | None]:
    """The recorded metrics; KinemimicError names those that deviate by more than their tolerance.

    Metrics without a tolerance must be equal.
    """
    deviating = [
        f"{metric} {_text(value)} instead of {_text(recorded[metric])} ± {tolerances.get(metric, 0.0):g}"
        for metric, value in found.items()
        if not _within(value, recorded[metric], tolerances.get(metric, 0.0))
    ]
    if deviating:
        raise KinemimicError(f"{name}: expected the scores on record, found {', '.join(deviating)}")
    return dict(recorded)


def _within(value: float | None, other: float | None, tolerance: float) -> bool:
    if value is None or other is None:
        return value is other
    return abs(value - other) <= tolerance


def _text(value: float | None) -> str:
    return "none" if value is None else f"{value:g}"


@click.command("score")
@click.argument("policy")
@params_option
@workers_option
@engine_option
@json_option("Print the scores.")
def command(policy: str, path: Path, workers: int | None, engine: str, as_json: bool) -> None:
    """Evaluate the shipped policy POLICY again, and write its scores if they match those on record.

    Used by `dvc repro`; works in the current folder.

    \b
      kinemimic datasets score walk
    """
    params = Params.load(path)
    if policy not in params.policies:
        raise KinemimicError(
            f"{path}: expected a policy among {', '.join(params.policies)}, found {policy!r}"
        )
    recorded = metrics(read_scores(POLICIES / policy / SCORES))
    if strange := params.tolerances.keys() - recorded.keys():
        raise KinemimicError(f"{path}: expected tolerances of compared metrics, found {min(strange)}")
    with TemporaryDirectory(prefix="kinemimic-") as folder:
        run = Path(folder)
        ShippedPolicies().prepare(policy, run)
        found = metrics(evaluate(run, workers=workers, engine=engine))
    kept = confirmed(recorded, found, params.tolerances, policy)
    target = path.parent / "scores" / f"{policy}.json"
    content = {"schema": SCHEMA, "policy": policy, **kept}
    write_json(target, content)
    click.echo(json.dumps(content, indent=2) if as_json else f"{target}")
