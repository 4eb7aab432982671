"""What `compare` left is read again, and what ships of it is enough."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from peers.compared import BUDGET

from kinemimic.evaluate.compare.comparison import SHIPPED, Comparison
from kinemimic.evaluate.paper.experiments.plan import OURS, compared_policies
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.train.scenario.scenario_file import find_scenario


def test_an_algorithm_takes_part_with_the_policies_of_all_seeds(compared: Callable[..., Path]) -> None:
    """Each seed's policy corrects by a hundredth of its number."""
    folder = compared(returns=(0.9, 0.1, 0.5))
    found = Comparison.load(folder).policies("walk", "ddpg", "DDPG")
    assert [one.name for one in found] == ["DDPG"] * 3
    assert [one.config.preset for one in found] == ["ddpg"] * 3
    for seed, one in enumerate(found):
        assert one.policy.layers[-1][1] == pytest.approx(0.01 * seed)
    # Early versions published one seed's.
    (folder / f"walk/ddpg/seed1/policy-{BUDGET}.safetensors").unlink()
    assert [one.config.seed for one in Comparison.load(folder).policies("walk", "ddpg", "DDPG")] == [0, 2]


def test_what_is_published_is_a_comparison_with_the_policies_of_all_seeds(
    compared: Callable[..., Path], tmp_path: Path
) -> None:
    whole = Comparison.load(compared(returns=(0.9, 0.1, 0.5)))
    whole.publish(tmp_path / "ships")
    ships = Comparison.load(tmp_path / "ships")
    assert ships.content == whole.content
    ours, theirs = (of.policies("run", "a2c", "A2C") for of in (ships, whole))
    assert [one.identity for one in ours] == [one.identity for one in theirs]
    assert len(list((tmp_path / "ships").rglob("*.safetensors"))) == 36


def test_a_comparison_without_a_policy_is_not_published(
    compared: Callable[..., Path], tmp_path: Path
) -> None:
    folder = compared(returns=(0.9, 0.1))
    (folder / f"run/a2c/seed1/policy-{BUDGET}.safetensors").unlink()
    with pytest.raises(KinemimicError, match="expected the policy of every seed, found no file"):
        Comparison.load(folder).publish(tmp_path / "ships")
    assert not (tmp_path / "ships").exists()


def test_what_failed_is_not_published(compared: Callable[..., Path], tmp_path: Path) -> None:
    whole = Comparison.load(compared())
    broken = Comparison(whole.folder, {**whole.content, "failed": {"walk ddpg seed 0": "it fell over"}})
    with pytest.raises(KinemimicError, match="found that walk ddpg seed 0 failed; nothing is published"):
        broken.publish(tmp_path / "ships")
    assert not (tmp_path / "ships").exists()


def test_the_policy_of_a_larger_budget_takes_the_place_of_the_one_before(
    compared: Callable[..., Path], tmp_path: Path
) -> None:
    whole = Comparison.load(compared())
    folder = tmp_path / "ships/walk/default/seed0"
    folder.mkdir(parents=True)
    for name in ("policy-1000.json", "policy-1000.safetensors"):
        (folder / name).write_text("")
    whole.publish(tmp_path / "ships")
    assert {path.stem for path in folder.iterdir()} == {f"policy-{BUDGET}"}


def test_a_comparison_is_not_published_onto_itself(compared: Callable[..., Path]) -> None:
    whole = Comparison.load(compared(returns=(0.9, 0.1, 0.5)))
    before = sorted(whole.folder.rglob("*"))
    with pytest.raises(KinemimicError, match="expected to publish to another folder than"):
        whole.publish(whole.folder / ".." / whole.folder.name)
    assert sorted(whole.folder.rglob("*")) == before


def test_what_is_published_later_joins_what_is_there(compared: Callable[..., Path], tmp_path: Path) -> None:
    """In whatever portions it was trained, what ships is what one comparison would have been."""
    ships, three = tmp_path / "ships", (0.9, 0.1, 0.5)
    portions = (
        compared("first", returns=three, on=["walk"], variants=["default", "a2c"]),
        compared("second", returns=three, on=["walk"], variants=["ddpg", "sb3-ppo"]),
        compared("third", returns=three, on=["run", "walk@several-obstacles"]),
        # Trained again: it takes the place of what there was.
        compared("again", returns=(0.1, 0.2, 0.3), on=["run"], variants=["ddpg"]),
    )
    for portion in portions:
        Comparison.load(portion).publish(ships)
    found = Comparison.load(ships)
    whole = Comparison.load(compared("whole", returns=three))
    found.expect(["walk", "run", "walk@several-obstacles"], ["default", "ddpg", "a2c", "sb3-ppo"])
    assert len(found.content["cells"]) == len(whole.content["cells"])
    assert len(found.content["curves"]) == len(whole.content["curves"])
    assert [row["return"] for row in found.cells("run", "ddpg")] == [0.1, 0.2, 0.3]
    for task in whole.content["tasks"]:
        for variant in ("default", "a2c", "sb3-ppo"):
            ours, theirs = (one.policies(task, variant, "one") for one in (found, whole))
            assert [one.identity for one in ours] == [one.identity for one in theirs]
    settings = whole.content["provenance"]["config"]
    assert found.content["provenance"]["config"] == settings


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda content: content["provenance"]["config"].update(seeds=5),
            "of the same seeds, found 1 there and 5 here",
        ),
        (lambda content: content["tasks"]["walk"].update(scenario_identity="x"), "same scenario of walk"),
        (lambda content: content["provenance"]["config"].update(engine="pybullet"), "of the same engine"),
        (lambda content: content["tasks"]["walk"].update(identity="x"), "of the same motion of walk"),
        (
            lambda content: content["provenance"]["config"]["variants"]["default"].update(discount=0.5),
            "of the same variants of default",
        ),
        (
            lambda content: content["provenance"]["config"]["variants"].update(
                a2c={**content["provenance"]["config"]["variants"]["default"], "env": {}}
            ),
            "of the same env",
        ),
        (
            lambda content: content["provenance"].update(versions={"torch": "1"}),
            "of the same version of torch, found '2' there and '1' here",
        ),
        (
            lambda content: content["provenance"]["config"]["budgets"].update(default=[1]),
            "of the same budgets of default",
        ),
    ],
)
def test_what_does_not_go_with_what_is_there_is_refused(
    change: Callable[[Any], None], message: str, compared: Callable[..., Path], tmp_path: Path
) -> None:
    Comparison.load(compared("one", on=["walk", "run"], variants=["default", "ddpg"])).publish(tmp_path / "s")
    before = (tmp_path / "s" / "compare.json").read_bytes()
    other = compared("other", on=["walk"], variants=["default"])
    content = json.loads((other / "compare.json").read_text())
    change(content)
    with pytest.raises(KinemimicError, match=message):
        Comparison(other, content).publish(tmp_path / "s")
    assert (tmp_path / "s" / "compare.json").read_bytes() == before


@pytest.mark.parametrize("name", ["../walk", "/walk", "a/b", "..", 3])
def test_a_task_is_no_way_out_of_the_folder(compared: Callable[..., Path], name: object) -> None:
    folder = compared()
    content = json.loads((folder / "compare.json").read_text())
    content["cells"][0]["task"] = name
    (folder / "compare.json").write_text(json.dumps(content))
    with pytest.raises(KinemimicError, match="expected names of tasks and presets"):
        Comparison.load(folder)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda content: content.pop("cells"), "found no 'cells'"),
        (lambda content: content.update(cells=[{}]), "found no 'task'"),
        (lambda content: content["cells"][0].pop("return"), "found no 'return'"),
        (lambda content: content["cells"][0].update(seed="0"), "whole seeds and budgets, found '0'"),
        (lambda content: content["curves"][0].pop("critic_loss"), "found no 'critic_loss'"),
        (lambda content: content.update(curves=[3]), "found 'int' object is not subscriptable"),
        (lambda content: content.update(provenance={}), "found no 'config'"),
        (lambda content: content.update(tasks=[["walk"]]), "found \\['walk'\\]"),
    ],
)
def test_damaged_results_are_one_line(
    change: Callable[[Any], object], message: str, compared: Callable[..., Path]
) -> None:
    folder = compared()
    content = json.loads((folder / "compare.json").read_text())
    change(content)
    (folder / "compare.json").write_text(json.dumps(content))
    with pytest.raises(KinemimicError, match=message):
        Comparison.load(folder)


def test_a_study_wants_every_seed_at_every_budget_and_none_failed(compared: Callable[..., Path]) -> None:
    whole = Comparison.load(compared(returns=(0.9, 0.1)))
    whole.expect(["walk"], ["default"])
    short = {**whole.content, "cells": whole.content["cells"][1:]}
    with pytest.raises(KinemimicError, match="found incomplete results of default on walk"):
        Comparison(whole.folder, short).expect(["walk"], ["default"])
    failed = {**whole.content, "failed": {"walk ddpg seed 0": "fell"}}
    with pytest.raises(KinemimicError, match="found that walk ddpg seed 0 failed"):
        Comparison(whole.folder, failed).expect(["walk"], ["default"])


def test_another_scenario_of_the_same_name_is_refused(compared: Callable[..., Path]) -> None:
    comparison = Comparison.load(compared())
    task, theirs = "walk@several-obstacles", find_scenario("several-obstacles")
    comparison.expect_scenario(task, theirs)
    with pytest.raises(KinemimicError, match="found another scenario of that name"):
        comparison.expect_scenario(task, replace(theirs, seconds=1.0))


def test_what_decides_a_contender_decides_its_identity(compared: Callable[..., Path]) -> None:
    one, *_ = Comparison.load(compared()).policies("walk", "default", "PPO")
    assert replace(one, name="another", samples=1).identity == one.identity
    assert replace(one, config=replace(one.config, discount=0.9)).identity != one.identity
    assert replace(one, motion=replace(one.motion, rate=29.0)).identity != one.identity
    assert replace(one, policy=replace(one.policy, mean=one.policy.mean + 1)).identity != one.identity


def test_what_is_missing_is_one_line(compared: Callable[..., Path], tmp_path: Path) -> None:
    folder = compared()
    comparison = Comparison.load(folder)
    with pytest.raises(
        KinemimicError, match="found incomplete results of robust on walk; repeat `kinemimic compare`"
    ):
        comparison.expect(["walk"], ["default", "robust"])
    comparison.expect(["walk", "run"], ["default", "ddpg"])
    (folder / "run" / "motion.json").write_bytes((folder / "walk" / "motion.json").read_bytes())
    with pytest.raises(KinemimicError, match="expected a policy of run's motion"):
        comparison.policies("run", "default", "PPO")
    with pytest.raises(KinemimicError, match="found no file; take datasets/comparison from the repository"):
        Comparison.load(tmp_path)
    (tmp_path / "compare.json").write_text(json.dumps({"schema": 7}))
    with pytest.raises(KinemimicError, match="expected results of `kinemimic compare`"):
        Comparison.load(tmp_path)


def test_what_ships_is_all_that_a_study_reads() -> None:
    shipped = Comparison.load(SHIPPED)
    cast = compared_policies(shipped)
    assert set(OURS) < set(cast)
    seeds = shipped.content["provenance"]["config"]["seeds"]
    assert {name: len(policies) for name, policies in cast.items()} == {
        name: 1 if name in OURS else seeds for name in cast
    }
