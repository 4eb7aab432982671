"""`kinemimic correct-tracker`: better knees and hips for a tracker."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from kinemimic.pipeline.cli.options import json_option, out_option, seed_option
from kinemimic.pipeline.cli.progress_state import minutes
from kinemimic.train.rollout.policy import POLICY
from kinemimic.train.sim.options import engine_option, workers_option
from kinemimic.train.tracker.correction import ROUNDS, correct_tracker


def summary(record: Mapping[str, Any]) -> list[str]:
    """A line for each round."""
    return [
        f"round {number}: corrections of {one['learned']} of {one['motions']} motions, R² of knee and hip "
        f"{one['r2']:.3f} on average, {'adopted' if one['adopted'] else 'not better, not adopted'}"
        for number, one in enumerate(record["corrections"], 1)
    ]


@click.command("correct-tracker")
@click.argument("library", type=click.Path(path_type=Path))
@out_option("Folder of the corrected policy.")
@click.option("--from", "start", metavar="POLICY", default="tracker", show_default=True,
              help="The tracker: a name or a folder.")  # fmt: skip
@click.option("--rounds", type=click.IntRange(1, 10), default=ROUNDS, show_default=True,
              help="Rounds of corrections and regression.")  # fmt: skip
@seed_option()
@engine_option
@workers_option
@json_option("Print the policy's record as JSON.")
def command(
    library: Path,
    out: Path,
    start: str,
    rounds: int,
    seed: int,
    workers: int | None,
    engine: str,
    as_json: bool,
) -> None:
    """Let a tracker unlearn its systematic errors at knees and hips, on the split `train` of LIBRARY.

    Takes minutes; Ctrl-C keeps what is done, and the same command resumes.

    \b
      kinemimic library recordings/ --out runs/library --test 07 --variants 1000
      kinemimic correct-tracker runs/library --from runs/tracker --out runs/corrected
    """
    record = correct_tracker(
        library, out, start=start, rounds=rounds, seed=seed, workers=workers, engine=engine
    )
    if as_json:
        click.echo(json.dumps(record, indent=2))
        return
    click.echo("\n".join(summary(record)))
    click.echo(
        f"{out / POLICY}: {record['samples']:,} samples in {minutes(record['seconds'])}, with those of "
        f"{start}, seed {seed}\n`kinemimic run CAPTURE --policy {out}` performs a capture with it."
    )
