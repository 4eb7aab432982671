"""`kinemimic disturb`: what a policy makes of forces, torques, obstacles, other ground: scenarios."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click
from rich.console import RenderableType

from kinemimic.evaluate.policies.shipped import run_options
from kinemimic.evaluate.robustness.scenario_trials import RECOVERED, conduct_all, figures, in_tasks
from kinemimic.pipeline.cli.options import json_option
from kinemimic.pipeline.cli.progress import progress
from kinemimic.pipeline.cli.terminal import grid, number, percent, show
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.provenance import provenance
from kinemimic.pipeline.files.store import file_hash, write_json
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.rollout.policy import POLICY, load_trained
from kinemimic.train.scenario.scenario import Scenario
from kinemimic.train.scenario.scenario_file import scenario, shipped_scenarios
from kinemimic.train.sim.engines import resolve
from kinemimic.train.sim.options import engine_option, workers_option

DISTURB_SCHEMA = 1
TRIALS = 100


def disturb(
    run: Path,
    scenarios: Sequence[Scenario],
    *,
    trials: int = TRIALS,
    seed: int = 0,
    workers: int | None = None,
    engine: str = "auto",
) -> dict[str, dict[str, Any]]:
    """Try run/policy.safetensors on run/motion.json in each scenario; writes scenario-NAME.json of each, and
    returns them by name.

    trials: of each scenario; seed: of what they draw; trial k of a seed is the same however many there are;
    workers: processes that simulate, all cores by default; engine: of `train/engines.py`.
    """
    engine = resolve(engine)
    names = [one.name for one in scenarios]
    if len(set(names)) < len(names):
        raise KinemimicError(f"expected scenarios of different names, found {', '.join(names)}: rename one")
    motion, policy, record = load_trained(run)
    config = TrainConfig.from_json(record["config"])
    tasks = [
        in_tasks(motion, policy, config, one, trials=trials, seed=seed, engine=engine) for one in scenarios
    ]
    with progress("trials", sum(map(len, tasks))) as bar:
        done = conduct_all(tasks, workers=workers, progress=bar.advance)
    results = {}
    for one, found in zip(scenarios, done, strict=True):
        results[one.name] = {
            "schema": DISTURB_SCHEMA,
            "scenario": one.to_json(),
            **figures(found),
            "each": {
                "phase": found.phases.round(6).tolist(),
                "fallen_at": [int(v) if v < found.rewards.shape[1] else None for v in found.fallen_at],
            },
            "train": {key: record.get(key) for key in ("preset", "samples", "seed")},
            "provenance": provenance(
                "disturb",
                inputs={"motion": motion.identity, "policy": file_hash(run / POLICY)},
                config={"trials": trials, "recovered": RECOVERED, "engine": engine},
                seed=seed,
            ),
        }
        write_json(run / f"scenario-{one.name}.json", results[one.name])
    return results


def table(results: Mapping[str, Mapping[str, Any]]) -> RenderableType:
    """The results for a terminal."""
    rows = grid("", "survived %", "95 %", "twins fell", "dip %", "recovered", "after s", "fell after s")
    for name, one in results.items():
        low, high = one["survived_95"]
        rows.add_row(
            name,
            percent(one["survived"]),
            f"{100 * low:.0f}-{100 * high:.0f}",
            str(one["twins_fallen"]),
            percent(one["dip"]["median"]),
            f"{one['recovered']}/{round(one['touched'] * one['trials'])}",
            number(one["recovery_s"]["median"], 1),
            number(one["fall_s"]["median"], 1),
        )
    return rows


def _list(told: Mapping[str, str]) -> RenderableType:
    """Scenarios by name, and what each is about."""
    rows = grid("", "", left=2)
    rows.show_header = False
    for name, about in told.items():
        rows.add_row(name, about)
    return rows


@click.command("disturb")
@click.argument("scenarios", nargs=-1, metavar="[SCENARIO]...")
@run_options()
@click.option(
    "--trials",
    type=click.IntRange(min=1, max=100_000),
    default=TRIALS,
    show_default=True,
    help="Of each scenario.",
)
@click.option(
    "--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Of what each trial draws."
)
@workers_option
@engine_option
@json_option("Print the results, or the list, as JSON.")
def command(
    run: Path,
    scenarios: tuple[str, ...],
    trials: int,
    seed: int,
    workers: int | None,
    engine: str,
    as_json: bool,
) -> None:
    """Forces, torques, obstacles, other ground: what the run's policy, or one that ships, makes of them.

    SCENARIO: names of those that ship, or TOML files of your own (docs/scenarios.md); without one, those that
    ship are listed. Each trial begins at a phase of its own. Results go into scenario-NAME.json.

    \b
      kinemimic disturb pull-forward thrown-ball --policy walk
      kinemimic disturb mine.toml --run runs/walk --trials 500
    """
    if not scenarios:
        told = {name: scenario(name).about for name in shipped_scenarios()}
        if as_json:
            click.echo(json.dumps(told, indent=2, ensure_ascii=False))
        else:
            show(_list(told))
        return
    results = disturb(
        run, [scenario(one) for one in scenarios], trials=trials, seed=seed, workers=workers, engine=engine
    )
    if as_json:
        click.echo(json.dumps(results, indent=2))
    else:
        show(
            table(results),
            "\nmedians; dip: the largest loss of reward against a twin to which nothing happens, where it "
            f"does not fall by itself; recovered: within {100 * RECOVERED:.0f} % of it to the end, of those "
            "in whom anything made a difference; seconds since the first difference",
        )
