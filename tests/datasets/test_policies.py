"""What ships is whole, small, and what it says it is."""

from __future__ import annotations

import re

import pytest

from kinemimic.evaluate.policies.recipe import POLICIES, recipes, tracker_recipes
from kinemimic.evaluate.policies.scores_file import read_tracker_scores
from kinemimic.evaluate.policies.shipped import (
    MOTION,
    POLICY,
    RECORD,
    SCORES,
    ShippedPolicies,
    motion_summary,
)
from kinemimic.evaluate.workflow.reproduce import LARGEST, publish
from kinemimic.pipeline.files.store import file_hash, read_json
from kinemimic.retarget.formats.motion_json import read_motion_json
from kinemimic.train.config.from_tracker import NAMES
from kinemimic.train.rollout.policy import Policy, read_record
from kinemimic.train.rollout.tracker_file import load_tracker


def test_every_recipe_has_been_made() -> None:
    assert ShippedPolicies().names() == tuple(recipes())
    assert ShippedPolicies().trackers() == tuple(tracker_recipes()) == ("tracker", "standing")


@pytest.mark.parametrize("name", ShippedPolicies().names())
def test_a_policy_that_ships_is_what_its_recipe_says(name: str, tmp_path) -> None:
    folder, recipe = POLICIES / name, recipes()[name]
    _, record = Policy.load(folder / POLICY)
    scores = read_json(folder / SCORES)
    preset = NAMES[recipe.preset] if recipe.start else recipe.preset
    assert (record["preset"], record["seed"]) == (preset, recipe.seed)
    assert record["config"]["budget"] == recipe.budget
    assert scores["provenance"]["inputs"]["policy"] == file_hash(folder / POLICY)
    assert record["provenance"]["versions"]["pybullet"]
    # That of a recording may not ship.
    assert (folder / MOTION).is_file() == (recipe.recording is None)
    if recipe.recording is None:
        assert motion_summary(read_motion_json(folder / MOTION)) == record["imitates"]
        publish(folder, recipe, tmp_path)
        assert read_record(tmp_path / name / RECORD) == read_record(folder / RECORD)


@pytest.mark.parametrize("name", ShippedPolicies().trackers())
def test_a_tracker_that_ships_is_what_its_recipe_says(name: str) -> None:
    folder, recipe = POLICIES / name, tracker_recipes()[name]
    policy, record = load_tracker(folder / POLICY)
    scores = read_tracker_scores(folder / SCORES)
    assert policy.critic  # so that a training may start from it
    assert (record["preset"], record["seed"]) == (recipe.preset, recipe.seed)
    assert record["config"]["budget"] == recipe.budget
    assert record["finished"]
    assert scores["provenance"]["inputs"]["policy"] == file_hash(folder / POLICY)
    unseen = {row["subject"] for row in scores["motions"] if row["split"] == "test"}
    seen = {row["subject"] for row in scores["motions"] if row["split"] == "train"}
    assert unseen == set(recipe.test) or not (recipe.test or seen)
    assert unseen
    assert not unseen & seen


@pytest.mark.parametrize("name", (*ShippedPolicies().names(), *ShippedPolicies().trackers()))
def test_its_files_are_small_and_name_no_machine(name: str) -> None:
    for path in (POLICIES / name).iterdir():
        assert path.name in {MOTION, POLICY, RECORD, SCORES}
        assert path.stat().st_size <= LARGEST
        if path.suffix == ".json":
            assert not re.search(r'"/\w|"[A-Z]:\\', path.read_text())
