"""`kinemimic evaluate-tracker`: scores of a tracker on the recorded motions of a library."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from kinemimic.evaluate.scoring.metrics.library_scores import score_library, summaries
from kinemimic.pipeline.cli.options import json_option, out_option
from kinemimic.pipeline.cli.progress import progress
from kinemimic.pipeline.cli.terminal import grid, number, show
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.provenance import provenance
from kinemimic.pipeline.files.store import file_hash, write_json
from kinemimic.retarget.library.library_file import MANIFEST, read_library
from kinemimic.retarget.library.variants import SUBJECT as VARIANTS
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.rollout.tracker_file import load_tracker, tracker_path
from kinemimic.train.sim.engines import resolve
from kinemimic.train.sim.options import engine_option, workers_option

SCORES = "tracker_scores.json"
SCHEMA = 1


def evaluate_tracker(
    source: Path,
    policy: str,
    out: Path,
    *,
    split: str | None = None,
    workers: int | None = None,
    engine: str = "auto",
) -> dict[str, Any]:
    """Score a tracker on the motions of the library in `source`, without its variants; returns the content of
    out/tracker_scores.json.

    policy: name of a shipped tracker, or folder of one; split: "train" or "test", None for both; workers,
    engine: as for `evaluate`. KinemimicError without a motion to score.
    """
    library, path = read_library(source), tracker_path(policy)
    actor, record = load_tracker(path)
    config = TrainConfig.from_json(record["config"], path.with_suffix(".json"), ("config",))
    indices = [
        index
        for index, entry in enumerate(library.entries)
        if entry.subject != VARIANTS and split in (None, entry.split)
    ]
    if not indices:
        part = f" in the split {split}" if split else ""
        raise KinemimicError(
            f"{source}: expected recorded motions{part}, found none; variants are not scored"
        )
    engine = resolve(engine)
    with progress("evaluate", len(indices), unit="motions") as bar:
        rows = score_library(
            library,
            indices,
            actor,
            config.measured_env,
            engine=engine,
            workers=workers,
            progress=bar.advance,
        )
    scores = {
        "schema": SCHEMA,
        "samples": record["samples"],
        "summary": summaries(rows),
        "motions": rows,
        "provenance": provenance(
            "evaluate-tracker",
            inputs={"library": file_hash(source / MANIFEST), "policy": file_hash(path)},
            config={"engine": engine, "split": split},
            seed=record.get("seed"),
        ),
    }
    write_json(out / SCORES, scores)
    return scores


@click.command("evaluate-tracker")
@click.argument("library", type=click.Path(path_type=Path))
@click.option("--policy", metavar="POLICY", default="tracker", show_default=True,
              help="Name of a shipped tracker, or folder of one.")  # fmt: skip
@out_option(f"Folder of {SCORES}.")
@click.option("--split", type=click.Choice(["train", "test"]), help="Score only this split. Default: both.")
@engine_option
@workers_option
@json_option("Print tracker_scores.json.")
def command(
    library: Path,
    policy: str,
    out: Path,
    split: str | None,
    workers: int | None,
    engine: str,
    as_json: bool,
) -> None:
    """Score a tracker on every recorded motion of LIBRARY (see `kinemimic library`).

    \b
      kinemimic evaluate-tracker runs/library --out runs/tracker
      kinemimic evaluate-tracker runs/library --policy runs/tracker --split test --out runs/tracker
    """
    scores = evaluate_tracker(library, policy, out, split=split, workers=workers, engine=engine)
    if as_json:
        click.echo(json.dumps(scores, indent=2))
        return
    table = grid("split", "kind", "motions", "success", "whole", "MPJPE mm", "R² knee", "R² hip", "speed")
    for row in scores["summary"]:
        table.add_row(
            row["split"],
            row["kind"],
            str(row["motions"]),
            f"{100 * row['succeeded']:.0f} %",
            f"{100 * row['whole']:.0f} %",
            number(row["mpjpe_l_mm"], 1),
            *(number(row[name], 3) for name in ("r2_knee", "r2_hip", "speed_ratio")),
        )
    show(table)
    click.echo(
        "success: from phase 0, all joints within 0.5 m on average; whole: no fall from any start phase; "
        f"the rest: medians, MPJPE root-relative\nscores of every motion: {out / SCORES}"
    )
