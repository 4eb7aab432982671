"""`kinemimic compare`: tasks by variants of the training by seeds, each trained and scored."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib.metadata import version
from os import sched_getaffinity
from pathlib import Path
from typing import Any

import click

from kinemimic.evaluate.compare.cell import Cell, conduct
from kinemimic.evaluate.compare.comparison import COMPARE_SCHEMA, Comparison
from kinemimic.evaluate.compare.job_runner import side_by_side
from kinemimic.evaluate.compare.ledger import Ledger, Watcher, alone
from kinemimic.evaluate.compare.table import tables
from kinemimic.evaluate.compare.task import MOTION, Task, about
from kinemimic.evaluate.compare.variants import SEARCH, ablation, search
from kinemimic.pipeline.cli.options import json_option
from kinemimic.pipeline.cli.progress import bars
from kinemimic.pipeline.cli.terminal import show
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.provenance import provenance
from kinemimic.pipeline.files.store import copy_file
from kinemimic.retarget.formats.motion_json import read_motion_json
from kinemimic.train.config.baseline_config import require_package
from kinemimic.train.config.budget import samples
from kinemimic.train.config.config import PRESETS, TrainConfig
from kinemimic.train.sim.engines import resolve
from kinemimic.train.sim.options import engine_option

FAILED = 1  # exit status where a cell failed


def compare(
    tasks: Sequence[Task],
    variants: Mapping[str, TrainConfig],
    *,
    seeds: int,
    budgets: Sequence[int],
    out: Path,
    limits: Mapping[str, int] | None = None,
    jobs: int | None = None,
    engine: str = "auto",
    anyway: bool = False,
) -> dict[str, Any]:
    """Train and score every task, variant and seed; writes and returns the content of out/compare.json.

    seeds: 0 to seeds - 1; budgets: samples, increasing, at which each is scored; limits: of the budgets the
    last of a variant that shall end sooner; jobs: cells side by side, each on one core, all cores by default.
    What is finished is not done again, and what was interrupted goes on. A cell that fails is told under
    `failed`, and the others go on.
    """
    engine, limits = resolve(engine), limits or {}
    motions = {task.name: task.motion for task in tasks}
    if len(motions) < len(tasks):
        raise KinemimicError(
            "expected run folders of different names, or one in different scenarios, found "
            f"{', '.join(task.name for task in tasks)}: rename one"
        )
    for name, limit in limits.items():
        if limit not in budgets:
            raise KinemimicError(
                f"--limit {name}: expected one of the budgets, {', '.join(f'{one:,}' for one in budgets)} "
                f"samples, found {limit:,}"
            )
    at = {
        name: tuple(budget for budget in budgets if budget <= limits.get(name, budget)) for name in variants
    }
    cells = [
        Cell(task.run, motions[task.name].identity, task.name, variant,
             replace(task.configured(config), seed=seed), at[variant], out, engine, anyway)
        for seed in range(seeds)
        for variant, config in variants.items()
        for task in tasks
    ]  # fmt: skip
    made: dict[str, Any] = {
        "schema": COMPARE_SCHEMA,
        "tasks": {task.name: about(task, motions[task.name]) for task in tasks},
        "provenance": provenance(
            "compare",
            inputs={name: motion.identity for name, motion in motions.items()},
            config={
                "variants": {name: config.to_json() for name, config in variants.items()},
                "seeds": seeds,
                "budgets": {name: list(few) for name, few in at.items()},
                "engine": engine,
            },
        ),
    }
    if any(config.baseline for config in variants.values()):
        require_package()
        made["provenance"]["versions"]["stable-baselines3"] = version("stable-baselines3")
    with alone(out), bars() as several:
        for task in tasks:
            there = out / task.name / MOTION
            if there.exists() and read_motion_json(there).identity != motions[task.name].identity:
                raise KinemimicError(
                    f"{out}: expected a comparison on the same motions, found another {task.name}; name "
                    "another --out"
                )
        for task in tasks:
            copy_file(task.run / MOTION, out / task.name / MOTION)
        ledger = Ledger(out, cells, made)
        watcher = Watcher(several, ledger)
        try:
            side_by_side(conduct, ledger.unfinished(), jobs or len(sched_getaffinity(0)), watcher)
        except KeyboardInterrupt:
            ledger.write()
            raise KeyboardInterrupt(f"{out}: the same command goes on from there") from None
        return ledger.write()


def increasing(value: str) -> tuple[int, ...]:
    """Numbers of samples as people write them, 1e6,2e6, in increasing order."""
    return tuple(sorted({samples(one) for one in value.split(",")}))


def layers(value: str) -> tuple[int, ...]:
    """Units of hidden layers as people write them, 128,64."""
    try:
        units = tuple(int(one) for one in value.split(","))
    except ValueError:
        units = ()
    if not units or min(units) < 1:
        raise click.BadParameter(f"expected units as 128,64, found {value!r}")
    return units


def _limit(context: click.Context, parameter: click.Parameter, values: tuple[str, ...]) -> dict[str, int]:
    pairs = [value.partition("=") for value in values]
    if wrong := [value for value, (_, sign, _) in zip(values, pairs, strict=True) if not sign]:
        raise click.BadParameter(f"expected VARIANT=SAMPLES, found {wrong[0]!r}", context, parameter)
    return {name: samples(text) for name, _, text in pairs}


@click.command("compare")
@click.argument("tasks", nargs=-1, required=True, metavar="RUN[@SCENARIO]...")
@click.option("--preset", "presets", multiple=True, type=click.Choice(list(PRESETS)),
              help="Repeatable; `default` unless said.")  # fmt: skip
@click.option("--ablation", "ablated", is_flag=True, help="`default`, and one change each against it.")
@click.option("--search", "searched", multiple=True, type=click.Choice(list(SEARCH)),
              help="A rival's preset, and what one would try first to better it; repeatable.")  # fmt: skip
@click.option("--only", "only", multiple=True, metavar="VARIANT",
              help="Of what an ablation or a search tries, these alone; repeatable.")  # fmt: skip
@click.option("--seeds", type=click.IntRange(min=1), default=5, show_default=True, help="How many.")
@click.option("--budgets", type=increasing, metavar="SAMPLES,…", default="1e6,2e6", show_default=True,
              help="Numbers of samples, each scored on the way to the last.")  # fmt: skip
@click.option("--limit", "limits", multiple=True, callback=_limit, metavar="VARIANT=SAMPLES",
              help="End one sooner than the others; repeatable.")  # fmt: skip
@click.option("--hidden", type=layers, metavar="UNITS,…",
              help="Hidden layers of all, as 128,64, in place of the presets'.")  # fmt: skip
@click.option("--jobs", type=click.IntRange(min=1), help="Trainings side by side; all cores by default.")
@click.option("--out", type=click.Path(path_type=Path, file_okay=False), default=Path("runs/compare"),
              show_default=True, help="Trainings and results.")  # fmt: skip
@engine_option
@click.option("--anyway", is_flag=True, help="Train also on motions that the gate before training refuses.")
@click.option("--publish", "ships", type=click.Path(path_type=Path, file_okay=False),
              help="Put here what `study` reads: results, of each variant the middle seed.")  # fmt: skip
@json_option("Print compare.json.")
def command(
    tasks: tuple[str, ...],
    presets: tuple[str, ...],
    ablated: bool,
    searched: tuple[str, ...],
    only: tuple[str, ...],
    seeds: int,
    budgets: tuple[int, ...],
    limits: dict[str, int],
    hidden: tuple[int, ...] | None,
    jobs: int | None,
    out: Path,
    engine: str,
    anyway: bool,
    ships: Path | None,
    as_json: bool,
) -> None:
    """Train and score each task with every variant and several seeds; medians over the seeds.

    RUN: folders that hold a motion.json, as `--run` of the other commands; with @SCENARIO, by name or file,
    all train in it, and are scored without it. What is finished in --out is not done again, and an
    interrupted comparison goes on.

    \b
      kinemimic compare runs/walk runs/run --seeds 5
      kinemimic compare runs/walk@several-obstacles --preset default --preset ddpg --limit ddpg=3e5
    """
    chosen = presets or (() if ablated or searched else ("default",))
    variants = {**(ablation() if ablated else {}), **{name: PRESETS[name] for name in chosen}}
    for baseline in searched:
        variants |= search(baseline)
    if strange := set(only) - variants.keys():
        raise KinemimicError(f"--only: expected some of {', '.join(variants)}, found {min(strange)!r}")
    if only:
        variants = {name: config for name, config in variants.items() if name in (*only, *presets)}
    if strange := limits.keys() - variants.keys():
        raise KinemimicError(f"--limit: expected one among {', '.join(variants)}, found {min(strange)!r}")
    if hidden and ablated:
        raise click.UsageError("--hidden: expected no --ablation, which tries other layers itself")
    if hidden:
        variants = {name: replace(config, hidden=hidden) for name, config in variants.items()}
    result = compare(
        [Task.parsed(text) for text in tasks], variants, seeds=seeds, budgets=budgets, limits=limits, out=out,
        jobs=jobs, engine=engine, anyway=anyway,
    )  # fmt: skip
    if ships is not None:
        Comparison(out, result).publish(ships)
    if as_json:
        click.echo(json.dumps(result, indent=2))
    else:
        show(*tables(result))
        click.echo(f"\ncompare: {out / 'compare.json'}, {out / 'compare.csv'}")
    if result["failed"]:
        click.get_current_context().exit(FAILED)
