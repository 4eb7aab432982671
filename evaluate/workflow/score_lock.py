"""`kinemimic datasets score`: a policy that ships, performed again, against the scores on record.

A figure within its tolerance of the one on record is written as recorded, so that every machine writes the
same file; one that is not, fails.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import click

from kinemimic.evaluate.policies.recipe import POLICIES
from kinemimic.evaluate.policies.shipped import SCORES, ShippedPolicies
from kinemimic.evaluate.scoring.command import evaluate
from kinemimic.pipeline.cli.options import json_option
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import read_json, write_json
from kinemimic.pipeline.gait.curve_metrics import SCORED_JOINTS
from kinemimic.retarget.versions.params import Params, params_option
from kinemimic.train.sim.options import engine_option, workers_option

SCHEMA = 1
Figures = Mapping[str, float | None]


def figures(scores: Mapping[str, Any]) -> dict[str, float | None]:
    """What is watched of scores.json: frames and start phases survived, fit, path; None is not measurable."""
    fit = {
        f"{joint}_{figure}": scores["fit"][joint][figure]
        for joint in SCORED_JOINTS
        for figure in ("r2", "rmse_deg", "max_gap_deg")
    }
    root = {name: scores["root"][name] for name in ("speed_ratio", "path_error_m")}
    return {"frames": scores["survival"]["frames"], "phases": scores["survival"]["phases"], **fit, **root}


def record(
    recorded: Figures, found: Figures, tolerances: Mapping[str, float], name: str
) -> dict[str, float | None]:
    """The figures as recorded; KinemimicError names those that are further off than their tolerance.

    A figure without a tolerance has to be the same.
    """
    off = [
        f"{figure} {_told(value)} instead of {_told(recorded[figure])} ± {tolerances.get(figure, 0.0):g}"
        for figure, value in found.items()
        if not _near(value, recorded[figure], tolerances.get(figure, 0.0))
    ]
    if off:
        raise KinemimicError(f"{name}: expected its scores on record, found {', '.join(off)}")
    return dict(recorded)


def _near(value: float | None, other: float | None, tolerance: float) -> bool:
    if value is None or other is None:
        return value is other
    return abs(value - other) <= tolerance


def _told(value: float | None) -> str:
    return "none" if value is None else f"{value:g}"


@click.command("score")
@click.argument("policy")
@params_option
@workers_option
@engine_option
@json_option("Print the scores.")
def command(policy: str, path: Path, workers: int | None, engine: str, as_json: bool) -> None:
    """Have POLICY, which ships, perform again, and write its scores if they are those on record.

    What `dvc repro` calls; works in the current folder.

    \b
      kinemimic datasets score walk
    """
    params = Params.load(path)
    if policy not in params.policies:
        raise KinemimicError(
            f"{path}: expected a policy among {', '.join(params.policies)}, found {policy!r}"
        )
    recorded = figures(read_json(POLICIES / policy / SCORES))
    if strange := params.tolerances.keys() - recorded.keys():
        raise KinemimicError(f"{path}: expected tolerances of figures that are watched, found {min(strange)}")
    with TemporaryDirectory(prefix="kinemimic-") as folder:
        run = Path(folder)
        ShippedPolicies().prepare(policy, run)
        found = figures(evaluate(run, workers=workers, engine=engine))
    kept = record(recorded, found, params.tolerances, policy)
    target = path.parent / "scores" / f"{policy}.json"
    content = {"schema": SCHEMA, "policy": policy, **kept}
    write_json(target, content)
    click.echo(json.dumps(content, indent=2) if as_json else f"{target}")
