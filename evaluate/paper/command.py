"""`kinemimic study`: reproduce the paper's sections 4.1 and 4.2 as a page with figures and tables."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import click
from rich.console import RenderableType

from kinemimic.evaluate.compare.comparison import RESULTS, SHIPPED, Comparison, TrainedPolicy
from kinemimic.evaluate.compare.table import table_csv
from kinemimic.evaluate.paper.claims.claim import formatted
from kinemimic.evaluate.paper.claims.claims import claims
from kinemimic.evaluate.paper.claims.summary import markdown
from kinemimic.evaluate.paper.experiments.head_to_head import contest_trials, head_to_head
from kinemimic.evaluate.paper.experiments.plan import (
    AHEAD,
    ROOM,
    SCENARIOS,
    compared_policies,
    policies_in,
)
from kinemimic.evaluate.paper.experiments.processing_times import measured_on, processing_times
from kinemimic.evaluate.paper.experiments.room_walks import rooms
from kinemimic.evaluate.paper.page.output import drawings, numbers
from kinemimic.evaluate.paper.page.page import study_page
from kinemimic.evaluate.robustness.scenario_trials import Trials
from kinemimic.pipeline.cli.options import json_option, out_option, ray_option, seed_option
from kinemimic.pipeline.cli.picture import save
from kinemimic.pipeline.cli.progress import Bar, progress
from kinemimic.pipeline.cli.progress_state import PERCENT
from kinemimic.pipeline.cli.terminal import grid, show
from kinemimic.pipeline.files.provenance import provenance
from kinemimic.pipeline.files.store import file_hash, read_json, write_json, write_text
from kinemimic.pipeline.parallel.cluster import cluster
from kinemimic.pipeline.parallel.ray_executor import RayExecutor
from kinemimic.train.scenario.scenario_file import find_scenario
from kinemimic.train.sim.engines import engine_identity, resolve
from kinemimic.train.sim.options import engine_option, workers_option

STUDY_SCHEMA = 5
TRIALS, ROOMS = 30, 12  # trials of each policy in each scenario; rooms that each walks through
PAGE = "study.html"
Row = Mapping[str, Any]
Cast = Mapping[str, Sequence[TrainedPolicy]]  # by name, the policies of all seeds


def study(
    comparison: Comparison,
    out: Path,
    *,
    trials: int = TRIALS,
    walks: int = ROOMS,
    seed: int = 0,
    workers: int | None = None,
    engine: str = "auto",
    ray: str | None = None,
) -> dict[str, Any]:
    """Measure, compare with the paper, and write study.html, study.json, claims.md, figures/, numbers/.

    trials: of each policy in each scenario; walks: rooms per policy; seed: of all random draws; workers:
    processes (default: all cores); engine: a name from `train/sim/engines.py`; ray: carry out trials and
    walks on a Ray cluster, at this address or, "local", started on this machine, with the same results;
    processing times are always measured here. Each finished part is kept in out/parts and reused while its
    inputs stay the same. Returns the content of study.json.
    """
    with nullcontext() if ray is None else cluster(ray):
        return _study(comparison, out, trials, walks, seed, workers, resolve(engine), ray)


def _study(
    comparison: Comparison,
    out: Path,
    trials: int,
    walks: int,
    seed: int,
    workers: int | None,
    engine: str,
    ray: str | None,
) -> dict[str, Any]:
    """As `study`, with a resolved engine, and with a cluster if `ray` is given."""
    cast = compared_policies(comparison)
    parts = _Parts(out / "parts", seed=seed, engine=engine)
    options: dict[str, Any] = {"seed": seed, "engine": engine, "workers": workers}
    if ray is not None:
        options["executor"] = RayExecutor(isolated=False, identity=partial(engine_identity, engine))
    with progress("study", len(cast) + 2, unit=PERCENT) as bar:
        contests = _contests(parts, cast, trials, options, bar)
        walked = _walks(parts, cast, walks, options, bar)
        times = parts.place("times", [], measured_on(workers)).measured(
            bar, partial(processing_times, seed=seed, workers=workers)
        )
    content = {
        "schema": STUDY_SCHEMA,
        "claims": [claim.to_json() for claim in claims(comparison, contests, walked, times)],
        "head_to_head": contests,
        "rooms": walked,
        "times": times,
        "provenance": provenance(
            "study",
            inputs={
                "comparison": file_hash(comparison.folder / RESULTS),
                **_identities(cast.values()),
            },
            config={"trials": trials, "rooms": walks, "engine": engine},
            seed=seed,
        ),
    }
    _write(comparison, out, content)
    return content


def _contests(
    parts: _Parts, cast: Cast, trials: int, options: Mapping[str, Any], bar: Bar
) -> list[dict[str, Any]]:
    """Rows of `head_to_head`, from the trials of every policy in its scenarios.

    All trials that are not kept share one pool of processes, so that no core waits for the last trial of each
    algorithm.
    """
    scenarios = {name: find_scenario(name) for name in SCENARIOS}
    found, missing = dict[str, Mapping[str, Sequence[Trials]]](), {}
    places = {}
    for name, policies in cast.items():
        faced = [scenarios[one] for one in SCENARIOS if name in policies_in(one, cast)]
        config = {"scenarios": [one.to_json() for one in faced], "trials": trials}
        place = places[name] = parts.place(f"trials of {name}", [policies], config)
        if (kept := place.kept()) is None:
            missing[name] = policies, faced
        else:
            found[name] = {where: list(map(Trials.from_json, of_seeds)) for where, of_seeds in kept.items()}
    bar.resumed(len(found))
    if missing:
        share = lambda done: bar.advance(done * len(missing))  # noqa: E731
        for name, of_scenarios in contest_trials(missing, trials=trials, progress=share, **options):
            found[name] = of_scenarios
            places[name].keep({
                where: [one.to_json() for one in of_seeds] for where, of_seeds in of_scenarios.items()
            })  # fmt: skip
    return head_to_head([(policies, found[name]) for name, policies in cast.items()], SCENARIOS, over=AHEAD)


def _walks(parts: _Parts, cast: Cast, walks: int, options: Mapping[str, Any], bar: Bar) -> Any:
    """Rows of `rooms`, from the walks of every policy through random rooms."""
    room, theirs = find_scenario(ROOM), [cast[one] for one in policies_in(ROOM, cast)]
    place = parts.place(ROOM, theirs, {"scenario": room.to_json(), "trials": walks})
    return place.measured(bar, partial(rooms, theirs, room, trials=walks, **options))


def _write(comparison: Comparison, out: Path, content: Row) -> None:
    """Write the study's page, figures and numbers. content: of study.json."""
    drawn = drawings(comparison, content)
    for name, draw in drawn.items():
        save(draw, out / "figures" / name)
    for name, rows in numbers(comparison, content).items():
        write_text(out / "numbers" / f"{name}.csv", table_csv(rows))
    write_json(out / "study.json", content)
    write_text(out / "claims.md", markdown(content["claims"]))
    write_text(out / PAGE, study_page(comparison, content, drawn))


def _identities(cast: Iterable[Sequence[TrainedPolicy]]) -> dict[str, str]:
    """Of every policy, by its name and the number of its seed."""
    return {f"{one.name} {k}": one.identity for policies in cast for k, one in enumerate(policies)}


class _Parts:
    """Cache of finished measurements, one file each."""

    def __init__(self, folder: Path, *, seed: int, engine: str) -> None:
        versions = dict(engine_identity(engine).versions)
        self._folder, self._always = folder, {"seed": seed, "engine": engine, "versions": versions}

    def place(self, name: str, cast: Sequence[Sequence[TrainedPolicy]], config: Row) -> _Part:
        """Of a measurement of these policies with these settings."""
        made = provenance(
            "study",
            inputs=_identities(cast),
            config={**config, **self._always, "schema": STUDY_SCHEMA},
        )
        return _Part(self._folder / f"{name}.json", json.loads(json.dumps(made)))


@dataclass(frozen=True)
class _Part:
    """A measurement's file, and what it is made from, as JSON values."""

    path: Path
    made_from: Any

    def kept(self) -> Any:
        """The measurement; None if there is none that was made from the same."""
        found = read_json(self.path) if self.path.exists() else None
        if isinstance(found, dict) and found.get("made_from") == self.made_from:
            return found["measured"]
        return None

    def keep(self, measured: Any) -> None:
        """Keep a measurement, JSON values."""
        write_json(self.path, {"made_from": self.made_from, "measured": measured})

    def measured(self, bar: Bar, measure: Callable[..., Any]) -> Any:
        """The kept measurement, or else the result of `measure`, which is called with `progress`, a function
        that takes the share finished since its last call."""
        found = self.kept()
        if found is not None:
            bar.resumed(1.0)
            return found
        found = measure(progress=bar.advance)
        self.keep(found)
        return found


def table(content: Row) -> RenderableType:
    """The claims as a table for a terminal."""
    rows = grid("", "", "paper", "here", left=2)
    rows.add_column("verdict", overflow="fold", min_width=24)
    rows.columns[0].no_wrap = True
    for claim in content["claims"]:
        paper, ours = (formatted(claim[key], claim["unit"]) for key in ("paper", "ours"))
        rows.add_row(claim["figure"], claim["what"], paper, ours, claim["verdict"])
    return rows


@click.command("study")
@click.option(
    "--comparison",
    "folder",
    type=click.Path(path_type=Path, file_okay=False),
    default=SHIPPED,
    help="Results of `compare`; default: the shipped ones.",
)
@out_option("Output folder.", Path("runs/study"))
@click.option("--trials", type=click.IntRange(min=1, max=100_000), default=TRIALS, show_default=True,
              help="Trials of every policy in each scenario.")  # fmt: skip
@click.option("--rooms", "walks", type=click.IntRange(min=1, max=10_000), default=ROOMS, show_default=True,
              help="Rooms that every policy walks through.")  # fmt: skip
@seed_option("Seed of the trials' random draws.")
@workers_option
@ray_option
@engine_option
@json_option("Print study.json.")
def command(
    folder: Path,
    out: Path,
    trials: int,
    walks: int,
    seed: int,
    workers: int | None,
    ray: str | None,
    engine: str,
    as_json: bool,
) -> None:
    """Repeat the paper's experiments with PPO, DDPG, A2C and any other baselines that were trained.

    study.html lists every number of the paper's section 4 next to ours. Figures are written as SVG and PNG,
    and numbers as CSV.

    Nothing is trained: the policies are those of `kinemimic compare`. An interrupted study resumes.

    \b
      kinemimic study --comparison runs/comparison
      kinemimic study --trials 100 --out runs/study
      kinemimic study --ray
    """
    if ray is not None and workers is not None:
        raise click.UsageError("--workers: expected none with --ray, which uses every core of the cluster")
    content = study(
        Comparison.load(folder), out, trials=trials, walks=walks, seed=seed, workers=workers, engine=engine,
        ray=ray,
    )  # fmt: skip
    if as_json:
        click.echo(json.dumps(content, indent=2))
    else:
        show(table(content))
        click.echo(f"\nstudy: {out / PAGE}")
