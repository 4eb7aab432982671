"""One line about a policy whose training has not finished."""

from __future__ import annotations

from pathlib import Path

import click

from kinemimic.evaluate.policies.scores_file import read_scores
from kinemimic.evaluate.policies.shipped import RECORD, SCORES
from kinemimic.train.config.training import Training
from kinemimic.train.rollout.policy import read_record, training_summary


def unfinished_rollouts(run: Path) -> str:
    """`training unfinished: 400,000 of 1,000,000 samples` for the rollouts that `evaluate` kept, or ""."""
    path = run / SCORES
    return Training.of(read_scores(path)["train"]).unfinished if path.exists() else ""


def unfinished_policy(run: Path) -> str:
    """The same for the run's policy, or ""; also without one."""
    path = run / RECORD
    return Training.of(training_summary(read_record(path))).unfinished if path.exists() else ""


def say(line: str) -> None:
    """Print a line to stderr, unless it is empty: stdout may hold JSON."""
    if line:
        click.echo(line, err=True)
