"""`kinemimic compare`: train and score every combination of task, training variant and seed."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from importlib.metadata import version
from os import sched_getaffinity
from pathlib import Path
from typing import Any

import click

from kinemimic.evaluate.compare.cell import Cell, train_and_score
from kinemimic.evaluate.compare.comparison import COMPARE_SCHEMA, Comparison
from kinemimic.evaluate.compare.job_runner import side_by_side
from kinemimic.evaluate.compare.ledger import Ledger, ProgressBars, exclusive
from kinemimic.evaluate.compare.packed_cell import train_cells_on
from kinemimic.evaluate.compare.table import tables
from kinemimic.evaluate.compare.task import ComparisonTask, task_summary
from kinemimic.evaluate.compare.variants import SEARCH, ablation, search
from kinemimic.pipeline.cli.options import jobs_option, json_option, out_option, ray_option
from kinemimic.pipeline.cli.progress import bars
from kinemimic.pipeline.cli.terminal import show
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.provenance import provenance
from kinemimic.pipeline.files.store import copy_file
from kinemimic.pipeline.parallel.cluster import cluster
from kinemimic.pipeline.parallel.ray_executor import RayExecutor
from kinemimic.retarget.formats.motion_json import MOTION, read_motion_json
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.baseline_config import OffPolicy, require_package
from kinemimic.train.config.budget import samples
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.presets import PRESETS
from kinemimic.train.runner.device import DEVICES, device_named, device_option
from kinemimic.train.sim.engines import engine_identity, resolve
from kinemimic.train.sim.options import engine_option

FAILED = 1  # exit status where a cell failed


def compare(
    tasks: Sequence[ComparisonTask],
    variants: Mapping[str, TrainConfig],
    *,
    seeds: int,
    budgets: Sequence[int],
    out: Path,
    limits: Mapping[str, int] | None = None,
    jobs: int | None = None,
    engine: str = "auto",
    anyway: bool = False,
    ray: str | None = None,
    device: str = "cpu",
) -> dict[str, Any]:
    """Train and score every task, variant and seed; writes and returns the content of out/compare.json.

    seeds: number of seeds, 0 to seeds - 1; budgets: increasing numbers of samples at which each policy is
    scored; limits: variant -> its last budget, to end it early; jobs: cells in parallel, sharing the cores
    (default: one per core); ray: train on a Ray cluster, one cell per core: its address, or "local" to start
    Ray on this machine. A cell whose node is lost is trained again from the state that this machine has.
    device: "cuda" updates the networks of DDPG, TD3 and SAC on a GPU, others on the CPU.
    Finished results are kept and interrupted training runs resume. A cell that fails is listed under
    `failed`; the others continue.
    """
    engine = resolve(engine)
    if device != DEVICES[0]:
        _require_gpu(device, variants, ray)
    cores = len(sched_getaffinity(0))
    jobs = jobs or cores
    motions = {task.name: task.motion for task in tasks}
    if len(motions) < len(tasks):
        raise KinemimicError(
            f"expected tasks with different names, found {', '.join(task.name for task in tasks)}: rename one"
        )
    scored_at = _budgets_of(variants, budgets, limits or {})
    cells = [
        Cell(task.run, motions[task.name].identity, task.name, variant,
             replace(task.configured(config), seed=seed), scored_at[variant], out, engine, anyway,
             # A policy of our PPO depends on the number of workers, a baseline's does not.
             workers=1 if config.baseline is None or ray is not None else max(1, cores // jobs),
             device=device if isinstance(config.baseline, OffPolicy) else DEVICES[0])
        for seed in range(seeds)
        for variant, config in variants.items()
        for task in tasks
    ]  # fmt: skip
    if any(config.baseline for config in variants.values()):
        require_package()
    header = _header(tasks, motions, variants, seeds=seeds, budgets=scored_at, engine=engine)
    with exclusive(out), bars() as several:
        _copy_motions(tasks, motions, out)
        ledger = Ledger(out, cells, header)
        watcher = ProgressBars(several, ledger)
        try:
            if ray is None:
                side_by_side(train_and_score, ledger.unfinished(), jobs, watcher)
            else:
                with cluster(ray):
                    executor = RayExecutor(isolated=False, identity=partial(engine_identity, engine))
                    train_cells_on(executor, ledger.unfinished(), watcher)
        except KeyboardInterrupt:
            ledger.write()
            raise KeyboardInterrupt(f"{out}: run the same command again to resume") from None
        return ledger.write()


def _require_gpu(device: str, variants: Mapping[str, TrainConfig], ray: str | None) -> None:
    """KinemimicError if no variant would be updated on a GPU, or there is none."""
    if ray is not None:
        raise KinemimicError("--device: expected cpu with --ray, which gives each training run one core")
    if not any(isinstance(config.baseline, OffPolicy) for config in variants.values()):
        raise KinemimicError(f"--device {device}: expected DDPG, TD3 or SAC, found {', '.join(variants)}")
    device_named(device)


def _budgets_of(
    variants: Iterable[str], budgets: Sequence[int], limits: Mapping[str, int]
) -> dict[str, tuple[int, ...]]:
    """Variant -> the budgets at which it is scored; KinemimicError for a limit that is none of them."""
    for name, limit in limits.items():
        if limit not in budgets:
            raise KinemimicError(
                f"--limit {name}: expected one of the budgets, {', '.join(f'{one:,}' for one in budgets)} "
                f"samples, found {limit:,}"
            )
    return {
        name: tuple(budget for budget in budgets if budget <= limits.get(name, budget)) for name in variants
    }


def _header(
    tasks: Sequence[ComparisonTask],
    motions: Mapping[str, Motion],
    variants: Mapping[str, TrainConfig],
    *,
    seeds: int,
    budgets: Mapping[str, Sequence[int]],
    engine: str,
) -> dict[str, Any]:
    """What compare.json says before any result: what is compared, and from what."""
    made = provenance(
        "compare",
        inputs={name: motion.identity for name, motion in motions.items()},
        config={
            "variants": {name: config.to_json() for name, config in variants.items()},
            "seeds": seeds,
            "budgets": {name: list(few) for name, few in budgets.items()},
            "engine": engine,
        },
    )
    if any(config.baseline for config in variants.values()):
        made["versions"]["stable-baselines3"] = version("stable-baselines3")
    return {
        "schema": COMPARE_SCHEMA,
        "tasks": {task.name: task_summary(task, motions[task.name]) for task in tasks},
        "provenance": made,
    }


def _copy_motions(tasks: Sequence[ComparisonTask], motions: Mapping[str, Motion], out: Path) -> None:
    """Copy each task's motion; KinemimicError, before any copy, if the folder has another one's results."""
    for task in tasks:
        copy = out / task.name / MOTION
        if copy.exists() and read_motion_json(copy).identity != motions[task.name].identity:
            raise KinemimicError(
                f"{out}: expected a comparison on the same motions, found another {task.name}; name "
                "another --out"
            )
    for task in tasks:
        copy_file(task.run / MOTION, out / task.name / MOTION)


def increasing(value: str) -> tuple[int, ...]:
    """Parse numbers of samples such as 1M,2M; sorted."""
    return tuple(sorted({samples(one) for one in value.split(",")}))


def layers(value: str) -> tuple[int, ...]:
    """Parse sizes of hidden layers such as 128,64."""
    try:
        units = tuple(int(one) for one in value.split(","))
    except ValueError:
        units = ()
    if not units or min(units) < 1:
        raise click.BadParameter(f"expected sizes such as 128,64, found {value!r}", param_hint="'--hidden'")
    return units


def _variants(
    presets: Sequence[str], searched: Sequence[str], only: Sequence[str], *, ablated: bool
) -> dict[str, TrainConfig]:
    """What is trained: presets, an ablation and searches; `only` restricts the latter two."""
    chosen = presets or (() if ablated or searched else ("default",))
    variants = {**(ablation() if ablated else {}), **{name: PRESETS[name] for name in chosen}}
    for baseline in searched:
        variants |= search(baseline)
    _expect_names("--only", only, variants)
    if not only:
        return variants
    return {name: config for name, config in variants.items() if name in (*only, *presets)}


def _with_layers(variants: Mapping[str, TrainConfig], hidden: tuple[str, ...]) -> dict[str, TrainConfig]:
    """The variants with the layers of --hidden: UNITS for all, VARIANT=UNITS for one."""
    pairs = [value.rpartition("=") for value in hidden]
    given = {name: layers(units) for name, _, units in pairs}
    _expect_names("--hidden", given.keys() - {""}, variants)
    return {
        name: replace(config, hidden=given.get(name, given.get("", config.hidden)))
        for name, config in variants.items()
    }


def _expect_names(option: str, names: Iterable[str], variants: Mapping[str, TrainConfig]) -> None:
    if strange := set(names) - variants.keys():
        raise KinemimicError(f"{option}: expected some of {', '.join(variants)}, found {min(strange)!r}")


def _limit(context: click.Context, parameter: click.Parameter, values: tuple[str, ...]) -> dict[str, int]:
    pairs = [value.partition("=") for value in values]
    if wrong := [value for value, (_, sign, _) in zip(values, pairs, strict=True) if not sign]:
        raise click.BadParameter(f"expected VARIANT=SAMPLES, found {wrong[0]!r}", context, parameter)
    return {name: samples(text) for name, _, text in pairs}


@click.command("compare")
@click.argument("tasks", nargs=-1, required=True, metavar="RUN[@SCENARIO]...")
@click.option("--preset", "presets", multiple=True, type=click.Choice(list(PRESETS)),
              help="Preset to train; repeatable. Default: `default`.")  # fmt: skip
@click.option("--ablation", "ablated", is_flag=True, help="Train `default` and its ablations.")
@click.option("--search", "searched", multiple=True, type=click.Choice(list(SEARCH)),
              help="Baseline whose settings to search; repeatable.")  # fmt: skip
@click.option("--only", "only", multiple=True, metavar="VARIANT",
              help="Restrict an ablation or a search to this variant; repeatable.")  # fmt: skip
@click.option("--seeds", type=click.IntRange(1, 1000), default=5, show_default=True, help="Number of seeds.")
@click.option("--budgets", type=increasing, metavar="SAMPLES,…", default="1e6,2e6", show_default=True,
              help="Numbers of samples at which to score.")  # fmt: skip
@click.option("--limit", "limits", multiple=True, callback=_limit, metavar="VARIANT=SAMPLES",
              help="End a variant early; repeatable.")  # fmt: skip
@click.option("--hidden", multiple=True, metavar="[VARIANT=]UNITS,…",
              help="Hidden layers of all variants, such as 128,64, or of one; repeatable; "
              "not with --ablation.")  # fmt: skip
@jobs_option("Parallel training runs; not with --ray.")
@out_option("Output folder.", Path("runs/compare"))
@device_option("Where the networks of DDPG, TD3 and SAC are updated; with cuda, SAC draws other actions.")
@ray_option
@engine_option
@click.option("--anyway", is_flag=True, help="Also train on motions that the check before training refuses.")
@click.option("--publish", "ships", type=click.Path(path_type=Path, file_okay=False),
              help="Copy the results that `study` reads to this folder.")  # fmt: skip
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
    hidden: tuple[str, ...],
    jobs: int | None,
    out: Path,
    device: str,
    ray: str | None,
    engine: str,
    anyway: bool,
    ships: Path | None,
    as_json: bool,
) -> None:
    """Train and score each task with every variant and several seeds; report medians over the seeds.

    RUN is a run folder with a motion.json. With @SCENARIO (name or file), policies are trained in that
    scenario and scored without it. Finished results in --out are kept, and an interrupted comparison resumes.

    \b
      kinemimic compare runs/walk runs/run --seeds 5
      kinemimic compare runs/walk@several-obstacles --preset default --preset ddpg --limit ddpg=3e5
    """
    if ray is not None and jobs is not None:
        raise click.UsageError("--jobs: expected none with --ray, which uses every core of the cluster")
    if hidden and ablated:
        raise click.UsageError("--hidden: expected no --ablation, which varies the layers itself")
    variants = _with_layers(_variants(presets, searched, only, ablated=ablated), hidden)
    _expect_names("--limit", limits, variants)
    result = compare(
        [ComparisonTask.parsed(text) for text in tasks], variants, seeds=seeds, budgets=budgets,
        limits=limits, out=out, jobs=jobs, engine=engine, anyway=anyway, ray=ray, device=device,
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
