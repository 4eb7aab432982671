"""`kinemimic evaluate`: scores a run's policy, or a session recorded by `simulate` or `stream`."""

from __future__ import annotations

import json
from pathlib import Path

import click

from kinemimic.evaluate.policies.shipped import run_options
from kinemimic.pipeline.cli.options import json_option
from kinemimic.pipeline.cli.printable import echo
from kinemimic.train.sim.options import engine_option, workers_option


@click.command("evaluate")
@run_options()
@workers_option
@engine_option
@json_option("Print scores.json, or the score of a session.")
def command(run: Path, workers: int | None, engine: str, as_json: bool) -> None:
    """Score the run's policy, or a shipped one, against reference, capture and true motion.

    If the folder holds a session recorded by `simulate` or `stream`: simulate it again on the engine that
    recorded it, check that every state is bit for bit the same, print its score and write session.rrd.

    \b
      kinemimic evaluate --run runs/walk
      kinemimic evaluate --policy walk
      kinemimic evaluate --run runs/walk/simulate/session-1
    """
    from kinemimic.evaluate.simulate.session.recording import SESSION  # noqa: PLC0415 (import cost)

    if (run / SESSION).exists():
        _session(run, as_json)
    else:
        _policy(run, workers, engine, as_json)


def _policy(run: Path, workers: int | None, engine: str, as_json: bool) -> None:
    from kinemimic.evaluate.scoring.evaluate import evaluate, table  # noqa: PLC0415 (import cost)
    from kinemimic.evaluate.scoring.reports.index_page import write_index  # noqa: PLC0415
    from kinemimic.pipeline.cli.terminal import show  # noqa: PLC0415

    scores = evaluate(run, workers=workers, engine=engine)
    write_index(run)
    if as_json:
        click.echo(json.dumps(scores, indent=2))
    else:
        # Without wrapping: a path broken over two lines cannot be opened.
        show(table(scores, run), wrap=False)


def _session(folder: Path, as_json: bool) -> None:
    from kinemimic.evaluate.simulate.replay import replay_session, replay_summary  # noqa: PLC0415 (rerun)

    found = replay_session(folder)
    echo(json.dumps(found, indent=2, allow_nan=False) if as_json else replay_summary(folder, found))
