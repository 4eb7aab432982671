"""Which algorithms a study has: PPO and the paper's baselines always, others where they were trained."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from kinemimic.evaluate.compare.comparison import Comparison
from kinemimic.evaluate.paper.plan import OBSTACLES, OURS, compared_policies, compared_variants, policies_in
from kinemimic.pipeline.errors import KinemimicError

PAPER = ("default", "ddpg", "a2c")


def test_the_papers_algorithms_are_enough(compared: Callable[..., Path]) -> None:
    found = compared_variants(Comparison.load(compared(variants=PAPER)))
    assert list(found.items()) == [("PPO", "default"), ("DDPG", "ddpg"), ("A2C", "a2c")]
    assert policies_in("pull-forward", found) == ("PPO", "DDPG", "A2C", *OURS)
    among = ("PPO, among obstacles", "DDPG, among obstacles", "A2C, among obstacles")
    assert policies_in("several-obstacles", found) == ("PPO", "DDPG", "A2C", *OURS, *among)


def test_others_take_part_where_they_were_trained(compared: Callable[..., Path]) -> None:
    comparison = Comparison.load(compared(variants=("sac", "td3", *PAPER)))
    found = compared_variants(comparison)
    assert list(found) == ["PPO", "DDPG", "A2C", "TD3", "SAC"]
    assert {"TD3", "SAC", "SAC, among obstacles"} <= set(compared_policies(comparison))


def test_a_baseline_of_the_paper_must_have_been_trained(compared: Callable[..., Path]) -> None:
    comparison = Comparison.load(compared(variants=("default", "ddpg", "td3")))
    with pytest.raises(KinemimicError, match="found incomplete results of a2c on walk, a2c on run"):
        compared_variants(comparison)


def test_an_algorithm_takes_part_in_all_tasks_or_in_none(compared: Callable[..., Path]) -> None:
    comparison = Comparison.load(compared(variants=("td3", *PAPER)))
    content = comparison.content
    cells = [row for row in content["cells"] if (row["task"], row["variant"]) != (OBSTACLES, "td3")]
    missing = Comparison(comparison.folder, {**content, "cells": cells})
    with pytest.raises(KinemimicError, match=f"found incomplete results of td3 on {OBSTACLES};"):
        compared_variants(missing)
