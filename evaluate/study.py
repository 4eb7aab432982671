"""`kinemimic study`: motions by variants of the training by seeds, each trained and scored."""

from __future__ import annotations

import fcntl
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from os import sched_getaffinity
from pathlib import Path
from typing import Any

import click

from kinemimic.evaluate.side_by_side import side_by_side
from kinemimic.evaluate.study_cell import MOTION, Cell, conduct, outcome
from kinemimic.evaluate.study_table import curves, figures, summary, table_csv, tables
from kinemimic.evaluate.variants import SEARCH, ablation, search, within
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.inspect.terminal import show
from kinemimic.pipeline.progress import Bar, Bars, bars
from kinemimic.pipeline.provenance import provenance
from kinemimic.pipeline.store import read_json, write_json, write_text
from kinemimic.retarget.export_json import motion_from_json
from kinemimic.train.budget import samples
from kinemimic.train.config import PRESETS, TrainConfig
from kinemimic.train.engines import resolve
from kinemimic.train.fit import JOINTS, SIDES
from kinemimic.train.options import engine_option
from kinemimic.train.scenario_file import scenario as read

STUDY_SCHEMA = 1
FAILED = 1  # exit status where a cell failed


def study(
    runs: Sequence[Path],
    variants: Mapping[str, TrainConfig],
    *,
    seeds: int,
    budgets: Sequence[int],
    out: Path,
    jobs: int | None = None,
    engine: str = "auto",
    anyway: bool = False,
) -> dict[str, Any]:
    """Train and score every motion, variant and seed; writes and returns the content of out/study.json.

    runs: folders with a motion.json; seeds: 0 to seeds - 1; budgets: samples, increasing, at which each
    is scored; jobs: cells side by side, each on one core, all cores by default. What is finished is not done
    again, and what was interrupted goes on. A cell that fails is told under `failed`, and the others go on.
    """
    engine = resolve(engine)
    motions = {_name(run): _about(run) for run in runs}
    if len(motions) < len(runs):
        raise KinemimicError(
            f"expected run folders of different names, found {', '.join(map(_name, runs))}: rename one"
        )
    cells = [
        Cell(run, motions[_name(run)]["identity"], _name(run), variant, replace(config, seed=seed),
             tuple(budgets), out, engine, anyway)
        for seed in range(seeds)
        for variant, config in variants.items()
        for run in runs
    ]  # fmt: skip
    made = {
        "schema": STUDY_SCHEMA,
        "motions": motions,
        "provenance": provenance(
            "study",
            inputs={name: about["identity"] for name, about in motions.items()},
            config={
                "variants": {name: config.to_json() for name, config in variants.items()},
                "seeds": seeds,
                "budgets": list(budgets),
                "engine": engine,
            },
        ),
    }
    with _alone(out), bars() as several:
        ledger = _Ledger(out, cells, made)
        watcher = _Watcher(several, ledger)
        try:
            side_by_side(conduct, ledger.unfinished(), jobs or len(sched_getaffinity(0)), watcher)
        except KeyboardInterrupt:
            ledger.write()
            raise KeyboardInterrupt(f"{out}: the same command goes on from there") from None
        return ledger.write()


def _name(run: Path) -> str:
    return run.resolve().name


def _about(run: Path) -> dict[str, Any]:
    """What the study says of a motion; ceiling: the loop's own R² against the capture, mean of both sides."""
    motion = motion_from_json(run / MOTION)
    gait = read_json(run / "gait.json") if (run / "gait.json").exists() else {}
    loop = gait.get("r2_loop_against_capture") or {}
    ceiling = {}
    for joint in JOINTS:
        both = [loop[name] for side in SIDES if loop.get(name := f"{joint}_{side}") is not None]
        ceiling[joint] = round(sum(both) / 2, 6) if len(both) == 2 else None
    return {
        "identity": motion.identity,
        "cyclic": motion.cyclic,
        "seconds": round(motion.duration, 6),
        "simulated": motion.simulated,
        "ceiling": ceiling,
    }


@contextmanager
def _alone(out: Path) -> Iterator[None]:
    """Two studies at once in one folder would train the same cells."""
    out.mkdir(parents=True, exist_ok=True)
    with (out / ".lock").open("w") as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise KinemimicError(
                f"{out}: expected to be alone here, found another study at work; wait, or name another --out"
            ) from None
        yield


class _Ledger:
    """The cells of a study, and what has become of each so far.

    failed: one line for each cell that went wrong.
    """

    def __init__(self, out: Path, cells: Sequence[Cell], made: Mapping[str, Any]) -> None:
        self._out, self._made = out, made
        self.cells, self.failed = cells, dict[str, str]()

    def finished(self, cell: Cell) -> dict[int, tuple[dict[str, Any], dict[str, Any]]]:
        """policy.json and scores.json of each finished budget; what another study left here is a failure."""
        try:
            found = {budget: outcome(cell, budget) for budget in cell.budgets}
        except KinemimicError as error:
            self.failed[cell.name] = str(error)
            return {}
        return {budget: both for budget, both in found.items() if both is not None}

    def unfinished(self) -> list[Cell]:
        """Cells with something left to do."""
        left = [cell for cell in self.cells if len(self.finished(cell)) < len(cell.budgets)]
        return [cell for cell in left if cell.name not in self.failed]

    def write(self) -> dict[str, Any]:
        """Write study.json and study.csv of what is finished; returns the content of the former."""
        rows = [
            {
                "motion": cell.motion,
                "variant": cell.variant,
                "seed": cell.config.seed,
                "budget": budget,
                "engine": record["engine"],
                **figures(record, scores),
            }
            for cell in self.cells
            for budget, (record, scores) in self.finished(cell).items()
        ]
        furthest: dict[tuple[str, str], list[dict[str, Any]]] = {}
        for cell in self.cells:
            if found := self.finished(cell):
                furthest.setdefault((cell.motion, cell.variant), []).append(found[max(found)][0])
        content = {
            **self._made,
            "summary": summary(rows),
            "curves": curves(furthest),
            "cells": rows,
            "failed": self.failed,
        }
        write_text(self._out / "study.csv", table_csv(rows))
        write_json(self._out / "study.json", content)
        return content


class _Watcher:
    """Draws a bar for all cells and one for each that runs, and has the ledger written after each."""

    def __init__(self, several: Bars, ledger: _Ledger) -> None:
        self._several, self._ledger = several, ledger
        self._running: dict[str, tuple[Bar, float]] = {}
        self._all = several.add("study", sum(cell.budgets[-1] for cell in ledger.cells))
        self._all.advance(sum(max(ledger.finished(cell), default=0) for cell in ledger.cells))
        for name, error in ledger.failed.items():
            several.say(f"{name}: {error}")

    def begun(self, cell: Cell) -> None:
        bar, done = (
            self._several.add(cell.name, cell.budgets[-1]),
            max(self._ledger.finished(cell), default=0),
        )
        bar.advance(done)
        self._running[cell.name] = (bar, done)

    def advanced(self, cell: Cell, description: str, done: float, fields: Mapping[str, object]) -> None:
        bar, before = self._running[cell.name]
        if description != "train":
            bar.advance(0, now=description)
            return
        # A training that goes on begins its count where it was.
        forward = max(0.0, done - before)
        self._running[cell.name] = (bar, before + forward)
        bar.advance(forward, **fields)
        self._all.advance(forward)

    def ended(self, cell: Cell, error: str | None) -> None:
        self._running.pop(cell.name)[0].remove()
        if error is not None:
            self._ledger.failed[cell.name] = " ".join(error.split())
            self._several.say(f"{cell.name}: {self._ledger.failed[cell.name]}")
        self._ledger.write()


def increasing(value: str) -> tuple[int, ...]:
    """Numbers of samples as people write them, 1e6,2e6, in increasing order."""
    return tuple(sorted({samples(one) for one in value.split(",")}))


@click.command("study")
@click.argument(
    "runs", nargs=-1, required=True, metavar="RUN...", type=click.Path(path_type=Path, file_okay=False)
)
@click.option("--preset", "presets", multiple=True, type=click.Choice(list(PRESETS)),
              help="Repeatable; `default` unless said.")  # fmt: skip
@click.option("--ablation", "ablated", is_flag=True, help="`default`, and one change each against it.")
@click.option("--search", "searched", multiple=True, type=click.Choice(list(SEARCH)),
              help="A rival's preset, and what one would try first to better it; repeatable.")  # fmt: skip
@click.option(
    "--scenario",
    "named",
    metavar="NAME",
    help="Train all in it, by name or file; they are scored without it.",
)
@click.option("--seeds", type=click.IntRange(min=1), default=5, show_default=True, help="How many.")
@click.option("--budgets", type=increasing, metavar="SAMPLES,…", default="1e6,2e6", show_default=True,
              help="Numbers of samples, each scored on the way to the last.")  # fmt: skip
@click.option("--jobs", type=click.IntRange(min=1), help="Trainings side by side; all cores by default.")
@click.option("--out", type=click.Path(path_type=Path, file_okay=False), default=Path("runs/study"),
              show_default=True)  # fmt: skip
@engine_option
@click.option("--anyway", is_flag=True, help="Train also on motions that the gate before training refuses.")
@click.option("--json", "as_json", is_flag=True, help="Print study.json.")
def command(
    runs: tuple[Path, ...],
    presets: tuple[str, ...],
    ablated: bool,
    searched: tuple[str, ...],
    named: str | None,
    seeds: int,
    budgets: tuple[int, ...],
    jobs: int | None,
    out: Path,
    engine: str,
    anyway: bool,
    as_json: bool,
) -> None:
    """Train and score each motion with every variant and several seeds; medians over the seeds.

    RUN: folders that hold a motion.json, as `--run` of the other commands. What is finished in --out is not
    done again, and an interrupted study goes on.
    """
    chosen = presets or (() if ablated or searched else ("default",))
    variants = {**(ablation() if ablated else {}), **{name: PRESETS[name] for name in chosen}}
    for rival in searched:
        variants |= search(rival)
    if named is not None:
        variants = within(variants, read(named))
    result = study(
        runs, variants, seeds=seeds, budgets=budgets, out=out, jobs=jobs, engine=engine, anyway=anyway
    )
    if as_json:
        click.echo(json.dumps(result, indent=2))
    else:
        show(*tables(result))
        click.echo(f"\nstudy: {out / 'study.json'}, {out / 'study.csv'}")
    if result["failed"]:
        click.get_current_context().exit(FAILED)
