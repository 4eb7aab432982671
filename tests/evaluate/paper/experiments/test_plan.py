"""Which algorithms a study has: PPO on all tasks, the paper's baselines on the walk, others where trained."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from kinemimic.evaluate.compare.comparison import Comparison
from kinemimic.evaluate.paper.experiments.plan import (
    OBSTACLES,
    OURS,
    RUN,
    WALK,
    compared_policies,
    compared_variants,
    policies_in,
)
from kinemimic.pipeline.errors import KinemimicError

PAPER = ("default", "ddpg", "a2c")


def without(folder: Path, variant: str, tasks: Sequence[str]) -> Comparison:
    """A comparison in which a variant was not trained on these tasks."""
    found = Comparison.load(folder)
    cells = [row for row in found.content["cells"] if row["variant"] != variant or row["task"] not in tasks]
    return Comparison(folder, {**found.content, "cells": cells})


def test_the_papers_algorithms_are_enough(compared: Callable[..., Path]) -> None:
    comparison = Comparison.load(compared(variants=PAPER))
    for task in (WALK, RUN, OBSTACLES):
        found = compared_variants(comparison, task)
        assert list(found.items()) == [("PPO", "default"), ("DDPG", "ddpg"), ("A2C", "a2c")]
    cast = compared_policies(comparison)
    assert policies_in("pull-forward", cast) == ("PPO", "DDPG", "A2C", *OURS)
    among = ("PPO, among obstacles", "DDPG, among obstacles", "A2C, among obstacles")
    assert policies_in("several-obstacles", cast) == ("PPO", "DDPG", "A2C", *OURS, *among)


def test_others_take_part_where_they_were_trained(compared: Callable[..., Path]) -> None:
    folder = compared(variants=("sac", "td3", *PAPER))
    assert list(compared_variants(Comparison.load(folder), WALK)) == ["PPO", "DDPG", "A2C", "TD3", "SAC"]
    walk_only = without(folder, "td3", (RUN, OBSTACLES))
    assert "TD3" in compared_variants(walk_only, WALK)
    assert list(compared_variants(walk_only, OBSTACLES)) == ["PPO", "DDPG", "A2C", "SAC"]
    cast = compared_policies(walk_only)
    assert {"TD3", "SAC", "SAC, among obstacles"} <= set(cast)
    assert "TD3, among obstacles" not in cast


def test_the_papers_baselines_must_have_been_trained_on_the_walk(compared: Callable[..., Path]) -> None:
    comparison = Comparison.load(compared(variants=("default", "ddpg", "td3")))
    assert list(compared_variants(comparison, RUN)) == ["PPO", "DDPG", "TD3"]
    with pytest.raises(KinemimicError, match="found incomplete results of a2c on walk;"):
        compared_variants(comparison, WALK)


def test_every_seed_must_have_been_trained(compared: Callable[..., Path]) -> None:
    comparison = Comparison.load(compared(returns=(0.5, 0.6), variants=("td3", *PAPER)))
    cells = [row for row in comparison.content["cells"] if (row["variant"], row["seed"]) != ("td3", 1)]
    part = Comparison(comparison.folder, {**comparison.content, "cells": cells})
    with pytest.raises(KinemimicError, match="found incomplete results of td3 on walk;"):
        compared_variants(part, WALK)
