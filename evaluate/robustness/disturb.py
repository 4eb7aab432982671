"""`kinemimic disturb`: trials of a policy with forces, torques, obstacles or different ground."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click
from rich.console import RenderableType

from kinemimic.evaluate.policies.shipped import run_options
from kinemimic.evaluate.policies.unfinished import say, unfinished_policy
from kinemimic.evaluate.robustness.scenario_trials import RECOVERED, run_all_trials, summarize, trial_tasks
from kinemimic.evaluate.scoring.reports.index_page import write_index
from kinemimic.pipeline.cli.options import json_option, seed_option
from kinemimic.pipeline.cli.progress import progress
from kinemimic.pipeline.cli.progress_state import PERCENT
from kinemimic.pipeline.cli.terminal import grid, number, percent, show
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.provenance import provenance
from kinemimic.pipeline.files.store import file_hash, write_json
from kinemimic.pipeline.run_folder.capture import only_run
from kinemimic.pipeline.run_folder.stage import reading, stage
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.rollout.policy import POLICY, load_trained, training_summary
from kinemimic.train.scenario.scenario import Scenario
from kinemimic.train.scenario.scenario_file import find_scenario, shipped_scenarios
from kinemimic.train.sim.engines import resolve
from kinemimic.train.sim.options import engine_option, workers_option

DISTURB_SCHEMA = 2
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
    """Trials of run/policy.safetensors on run/motion.json in each scenario.

    Writes scenario-NAME.json for each, and returns their contents by name. trials: per scenario; trial k of a
    seed does not depend on their number; workers: processes, all cores by default; engine: see
    `train/sim/engines.py`.
    """
    engine = resolve(engine)
    names = [one.name for one in scenarios]
    if len(set(names)) < len(names):
        raise KinemimicError(f"expected scenarios of different names, found {', '.join(names)}: rename one")
    with reading(run, "disturb"):
        results = _disturb(run, scenarios, trials=trials, seed=seed, workers=workers, engine=engine)
        for name, result in results.items():
            with stage(run, f"disturb {name}") as out:
                write_json(out / f"scenario-{name}.json", result)
    return results


def _disturb(
    run: Path, scenarios: Sequence[Scenario], *, trials: int, seed: int, workers: int | None, engine: str
) -> dict[str, dict[str, Any]]:
    motion, policy, record = load_trained(run)
    config = TrainConfig.from_json(record["config"])
    tasks = trial_tasks(motion, policy, config, scenarios, trials=trials, seed=seed, engine=engine)
    with progress("disturb", len(tasks), unit=PERCENT) as bar:
        ((_, done),) = run_all_trials([tasks], workers=workers, progress=bar.advance)
    results = {}
    for one, found in zip(scenarios, done, strict=True):
        results[one.name] = {
            "schema": DISTURB_SCHEMA,
            "scenario": one.to_json(),
            **summarize(found),
            "per_trial": {
                "phase": found.phases.round(6).tolist(),
                "fallen_at": [int(v) if v < found.rewards.shape[1] else None for v in found.fallen_at],
            },
            "train": training_summary(record),
            "provenance": provenance(
                "disturb",
                inputs={"motion": motion.identity, "policy": file_hash(run / POLICY)},
                config={"trials": trials, "recovered": RECOVERED, "engine": engine},
                seed=seed,
            ),
        }
    return results


def table(results: Mapping[str, Mapping[str, Any]]) -> RenderableType:
    """The results for a terminal."""
    rows = grid("", "survived %", "95 %", "control fell", "drop %", "recovered", "after s", "fell at s")
    for name, one in results.items():
        low, high = one["survived_ci95"]
        rows.add_row(
            name,
            percent(one["survived"]),
            f"{100 * low:.0f}-{100 * high:.0f}",
            str(one["controls_fallen"]),
            percent(one["reward_drop"]["median"]),
            f"{one['recovered']}/{round(one['affected'] * one['trials'])}",
            number(one["typical_recovery_s"], 1),
            number(one["typical_fall_s"], 1),
        )
    return rows


def _list(descriptions: Mapping[str, str]) -> RenderableType:
    """Names and descriptions of scenarios."""
    rows = grid("", "", left=2)
    rows.show_header = False
    for name, about in descriptions.items():
        rows.add_row(name, about)
    return rows


@click.command("disturb")
@click.argument("scenarios", nargs=-1, metavar="[SCENARIO]...")
@run_options(optional=True)
@click.option(
    "--trials",
    type=click.IntRange(min=1, max=100_000),
    default=TRIALS,
    show_default=True,
    help="Trials per scenario.",
)
@seed_option("Random seed of the trials.")
@workers_option
@engine_option
@json_option("Print the results, or the list, as JSON.")
def command(
    run: Path | None,
    scenarios: tuple[str, ...],
    trials: int,
    seed: int,
    workers: int | None,
    engine: str,
    as_json: bool,
) -> None:
    """Test the run's policy, or a shipped one, with forces, torques, obstacles or different ground.

    SCENARIO: shipped scenarios by name, or your own TOML files (docs/scenarios.md); without one, the shipped
    scenarios are listed. Each trial starts at its own phase. Results go into scenario-NAME.json.

    \b
      kinemimic disturb pull-forward thrown-ball --policy walk
      kinemimic disturb mine.toml --run runs/walk --trials 500
    """
    if not scenarios:
        descriptions = {name: find_scenario(name).about for name in shipped_scenarios()}
        if as_json:
            click.echo(json.dumps(descriptions, indent=2))
        else:
            show(_list(descriptions))
        return
    run = run or only_run()
    say(unfinished_policy(run))
    results = disturb(
        run,
        [find_scenario(one) for one in scenarios],
        trials=trials,
        seed=seed,
        workers=workers,
        engine=engine,
    )
    write_index(run)
    if as_json:
        click.echo(json.dumps(results, indent=2))
    else:
        show(
            table(results),
            "\nDrop and times: medians over the affected trials, whose reward differs from that of an "
            "undisturbed control run without a fall. Drop: largest loss of reward. Recovered: trials that "
            f"end no more than {100 * RECOVERED:.0f} % of the largest reward below the control. Times count "
            "from the first difference; a dash where fewer than half recover or fall.",
        )
