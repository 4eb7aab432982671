"""One line about a policy whose training has not finished."""

from __future__ import annotations

from pathlib import Path

import click

from kinemimic.evaluate.policies.shipped import RECORD, SCORES
from kinemimic.pipeline.files.store import read_json
from kinemimic.train.config.training import Training
from kinemimic.train.rollout.policy import training_summary


def unfinished_rollouts(run: Path) -> str:
    """`training unfinished: 400,000 of 1,000,000 samples` for the rollouts that `evaluate` kept, or ""."""
    path = run / SCORES
    scores = read_json(path) if path.exists() else None
    summary = scores.get("train") if isinstance(scores, dict) else None
    return Training.of(summary).unfinished if isinstance(summary, dict) else ""


def unfinished_policy(run: Path) -> str:
    """The same for the run's policy, or ""; also without one."""
    path = run / RECORD
    record = read_json(path) if path.exists() else None
    return Training.of(training_summary(record)).unfinished if isinstance(record, dict) else ""


def say(line: str) -> None:
    """Print a line to stderr, unless it is empty: stdout may hold JSON."""
    if line:
        click.echo(line, err=True)
