"""`kinemimic pushes`: the hardest push that the humanoid survives in each direction; pushes.json."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click
import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from kinemimic.evaluate.policies.shipped import run_options
from kinemimic.evaluate.policies.unfinished import say, unfinished_policy
from kinemimic.evaluate.robustness.push_trials import (
    DIRECTIONS,
    EXTENDED_GRID,
    GRID,
    RESOLUTION,
    PushTask,
    SearchResult,
    push_from_all_directions,
    push_phases,
)
from kinemimic.evaluate.scoring.reports.index_page import write_index
from kinemimic.pipeline.cli.options import json_option
from kinemimic.pipeline.cli.progress import progress
from kinemimic.pipeline.cli.terminal import show
from kinemimic.pipeline.files.provenance import provenance
from kinemimic.pipeline.files.store import file_hash, write_json
from kinemimic.pipeline.parallel.task_pool import parallel_map
from kinemimic.pipeline.run_folder.stage import stage
from kinemimic.retarget.humanoid.body import BODIES
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.recovery.pushes import PELVIS, PUSH, SETTLE, SURVIVE
from kinemimic.train.rollout.policy import POLICY, load_trained, training_summary
from kinemimic.train.sim.engines import resolve
from kinemimic.train.sim.options import engine_option, workers_option
from kinemimic.train.sim.world import CONTROL_RATE

PUSHES_SCHEMA = 2
PHASES = 20
SHARES = (50, 90)  # % of the phases

_PROTOCOL: dict[str, Any] = {
    "body": BODIES[PELVIS].name,
    "push_s": PUSH / CONTROL_RATE,
    "settle_s": SETTLE / CONTROL_RATE,
    "survive_s": SURVIVE / CONTROL_RATE,
    "grid_n": list(GRID),
    "beyond_n": list(EXTENDED_GRID),
    "resolution_n": RESOLUTION,
}


def pushes(
    run: Path, *, phases: int = PHASES, workers: int | None = None, engine: str = "auto"
) -> dict[str, Any]:
    """Push run/policy.safetensors on run/motion.json; writes and returns the content of pushes.json.

    phases: number of phases of the motion at which pushes start; workers: processes, all cores by default;
    engine: see `train/sim/engines.py`.
    """
    with stage(run, "pushes") as out:
        result = _pushes(run, phases=phases, workers=workers, engine=resolve(engine))
        write_json(out / "pushes.json", result)
    return result


def _pushes(run: Path, *, phases: int, workers: int | None, engine: str) -> dict[str, Any]:
    motion, policy, record = load_trained(run)
    config = TrainConfig.from_json(record["config"]).env
    at = push_phases(motion, phases)
    with progress("pushes", phases, unit="phases") as bar:
        # One phase per task: results must not depend on the number of processes.
        tasks = [PushTask(motion, policy, config, float(phase), engine) for phase in at]
        found = parallel_map(push_from_all_directions, tasks, workers=workers, progress=bar.advance)
    return {
        "schema": PUSHES_SCHEMA,
        "phases": at.tolist(),
        **summary(found),
        "train": training_summary(record),
        "provenance": provenance(
            "pushes",
            inputs={"motion": motion.identity, "policy": file_hash(run / POLICY)},
            config={**_PROTOCOL, "phases": phases, "engine": engine},
            seed=record.get("seed"),
        ),
    }


def force_survived_by(thresholds: Sequence[float], percent: int) -> float:
    """The largest force, N, below the thresholds of at least `percent` % of the phases."""
    needed = -(-percent * len(thresholds) // 100)
    return sorted(thresholds, reverse=True)[needed - 1]


def summary(found: Sequence[Sequence[SearchResult]]) -> dict[str, Any]:
    """Results of the searches of all phases and directions.

    directions: per direction the force survived by each of SHARES, every phase's threshold, and the share of
    phases that survive each force of GRID; weakest_n: per share the minimum over all directions;
    survived_unpushed: share of all searches in which the humanoid stays upright without a push.
    """
    directions: dict[str, Any] = {}
    for k, name in enumerate(DIRECTIONS):
        ones = [phase[k] for phase in found]
        thresholds = [one.threshold for one in ones]
        directions[name] = {
            "survived_n": {str(percent): force_survived_by(thresholds, percent) for percent in SHARES},
            "thresholds_n": thresholds,
            "grid": np.mean([one.grid for one in ones], axis=0).tolist(),
        }
    return {
        "directions": directions,
        "weakest_n": {
            str(percent): min(one["survived_n"][str(percent)] for one in directions.values())
            for percent in SHARES
        },
        "survived_unpushed": float(np.mean([one.survived_unpushed for phase in found for one in phase])),
    }


def table(result: dict[str, Any]) -> RenderableType:
    """The result for a terminal."""
    protocol = result["provenance"]["config"]
    grid = Table("", header_style="bold", box=None, pad_edge=False)
    for percent in SHARES:
        grid.add_column(f"{percent} %", justify="right")
    for force in protocol["grid_n"]:
        grid.add_column(f"{force:.0f}", justify="right", style="dim")
    for name, one in result["directions"].items():
        forces = [_force(one["survived_n"][str(percent)]) for percent in SHARES]
        grid.add_row(name, *forces, *(f"{100 * share:.0f}" for share in one["grid"]))
    above = [
        f"largest push in N survived at {' and '.join(f'{percent} %' for percent in SHARES)} of "
        f"{len(result['phases'])} phases; then the % of phases at which each force in N is survived",
        f"({protocol['push_s']:.1f} s on the {protocol['body']}; survived: still upright "
        f"{protocol['survive_s']:.0f} s later)",
    ]
    if result["survived_unpushed"] < 1.0:
        above.append(
            f"without a push {100 * result['survived_unpushed']:.0f} % stay upright; the others count as 0 N"
        )
    return Group(*(Text(line) for line in above), grid)


def _force(newton: float) -> str:
    return f"{newton:.0f}" if newton < EXTENDED_GRID[-1] else f"≥{newton:.0f}"


@click.command("pushes")
@run_options()
@workers_option
@engine_option
@json_option("Print pushes.json.")
def command(run: Path, workers: int | None, engine: str, as_json: bool) -> None:
    """Measure the hardest push (0.2 s on the pelvis) that the run's policy, or a shipped one, survives.

    Pushes forward, backward, left and right at 20 phases each; pushes.json has the forces survived at 50 %
    and at 90 % of the phases.

    \b
      kinemimic pushes --run runs/walk
      kinemimic pushes --policy robust_walk --json
    """
    say(unfinished_policy(run))
    result = pushes(run, workers=workers, engine=engine)
    write_index(run)
    if as_json:
        click.echo(json.dumps(result, indent=2))
    else:
        show(table(result))
