"""The study, with policies that do nothing: every file is there, and nothing is measured twice."""

from __future__ import annotations

import csv
import json
import pickle
import re
import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from markupsafe import escape
from peers.compared import BUDGET, KEPT
from peers.ray_nodes import RayNodes
from printed.documented import documented_keys

from kinemimic.evaluate.compare.comparison import Comparison
from kinemimic.evaluate.paper import command as module
from kinemimic.evaluate.paper.claims.claim import UNTRAINED, formatted
from kinemimic.evaluate.paper.experiments import head_to_head as contest
from kinemimic.evaluate.paper.experiments import room_walks as walks
from kinemimic.evaluate.paper.experiments.head_to_head import contest_trials, head_to_head
from kinemimic.evaluate.paper.experiments.plan import (
    SCENARIOS,
    VARIANTS,
    WALK,
    compared_policies,
    policies_in,
)
from kinemimic.evaluate.robustness import scenario_trials
from kinemimic.pipeline.cli.progress import reported_to
from kinemimic.pipeline.cli.terminal import show
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.train.scenario.scenario import Scenario
from kinemimic.train.scenario.scenario_file import find_scenario


def cut(name: str) -> Scenario:
    """A second of a scenario, rooms without bends or furniture."""
    return replace(find_scenario(name), seconds=1.0, obstacles=(), route=())


def times(*, seed: int, workers: int | None, progress: Callable[[float], object]) -> dict[str, Any]:
    """Times that nobody measured."""
    progress(1.0)
    one = {"mean_ms": [1.0, 2.0, 3.0], "deviation_ms": [0.1, 0.1, 0.1], "growth": 1.0}
    algorithm = {"update": one, "inference": one, "learning": {"mean_ms": [1.0, 2.0, 3.0]}}
    algorithms = {"ppo": algorithm, "ddpg": algorithm, "a2c": None, "sb3-ppo": algorithm}
    nets = [{"hidden": [8, 4], "algorithms": algorithms}, {"hidden": [16, 8], "algorithms": algorithms}]
    samples = [1000, 2000, 3000]
    return {"samples": samples, "nets": nets, "repeats": 1, "paper": {"ppo": one, "ddpg": one}}


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Little of everything, in this process."""
    monkeypatch.setattr(module, "find_scenario", cut)

    def mapped(work: Any, tasks: Any, *, progress: Any, **_: Any) -> list[Any]:
        done = [work(task) for task in tasks]
        progress(len(done))
        return done

    monkeypatch.setattr(walks, "parallel_map", mapped)
    monkeypatch.setattr(
        scenario_trials, "unordered_map", lambda work, tasks, **_: enumerate(map(work, tasks))
    )
    monkeypatch.setattr(module, "processing_times", times)


@pytest.mark.usefixtures("short")
def test_a_study_is_a_page_figures_and_numbers_and_is_not_done_twice(
    compared: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, out = compared(), tmp_path / "out"
    arguments = [f"--comparison={folder}", f"--out={out}", "--trials=2", "--rooms=3", "--engine=pybullet"]
    ended = CliRunner().invoke(module.command, [*arguments, "--json"], catch_exceptions=False)
    assert ended.exit_code == 0, ended.output
    content = json.loads((out / "study.json").read_text())
    assert json.loads(ended.stdout) == content
    assert documented_keys("study.json") == set(content)
    rows = [(row["policy"], row["scenario"]) for row in content["head_to_head"]]
    cast = compared_policies(Comparison.load(folder))
    assert rows == [(name, scenario) for scenario in SCENARIOS for name in policies_in(scenario, cast)]
    # All through the same room, which of the three is PPO's middle one.
    assert len({row["shown"]["number"] for row in content["rooms"]}) == 1
    assert all(len(row["walks"]) == 3 for row in content["rooms"])
    for name in ("fig7", "fig8", "fig9", "fig10", "fig11", "fig12", "tab2"):
        assert (out / "figures" / f"{name}.png").read_bytes().startswith(b"\x89PNG")
        assert (out / "figures" / f"{name}.svg").read_text().startswith("<?xml")
    for name in ("claims", "learning", "disturbances", "rooms", "times"):
        with (out / "numbers" / f"{name}.csv").open() as stream:
            assert list(csv.DictReader(stream)), name
    page = (out / module.PAGE).read_text()
    for claim in content["claims"]:
        assert escape(claim["what"]) in page
    assert (
        "DDPG: 64 environments, a gradient step for every 8 samples on 256, layers of 512 and 256 (relu)"
        in page
    )
    assert "actions bounded to ±0.5, exploration 0.2 to 0.17." in page
    assert f"PPO {KEPT:,} of {BUDGET:,}; DDPG {KEPT:,} of {BUDGET:,};" in page
    # Nobody leads PPO; the baselines among obstacles are compared with the PPO trained there.
    led = {row["policy"] for row in content["head_to_head"] if row["lead"] is not None}
    assert led == {"DDPG", "A2C", "DDPG, among obstacles", "A2C, among obstacles"}
    # It asks for nothing from outside.
    assert not re.search(r"(src|href|srcset)=[\"'](?!data:|#)", page)
    assert not re.search(r"url\((?!#)", page)

    def never(*_: object, **__: object) -> None:
        raise AssertionError("measured again")

    with monkeypatch.context() as patched:
        for measure in ("contest_trials", "rooms", "processing_times"):
            patched.setattr(module, measure, never)
        again = CliRunner().invoke(module.command, [*arguments, "--json"], catch_exceptions=False)
        assert json.loads(again.stdout) == content
        assert (out / module.PAGE).read_text() == page
        with pytest.raises(AssertionError, match="measured again"):
            CliRunner().invoke(module.command, [*arguments, "--seed=1"], catch_exceptions=False)


def test_claims_are_printed_beside_their_verdicts(capsys: pytest.CaptureFixture[str]) -> None:
    claims = json.loads((Path(__file__).parents[2] / "docs/study_claims.json").read_text())
    show(module.table({"claims": claims}))
    printed = capsys.readouterr().out
    for claim in claims:
        assert claim["figure"] in printed
        assert claim["what"].split()[-1] in printed
        assert formatted(claim["paper"], claim["unit"]) in printed


@pytest.mark.usefixtures("short")
def test_an_interrupted_study_measures_what_is_missing(
    compared: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    comparison = Comparison.load(compared())
    asked: list[list[str]] = []

    def watched(contests: Any, **options: Any) -> Any:
        asked.append(list(contests))
        for name, found in contest_trials(contests, **options):
            yield name, found
            if len(asked) == 1 and name == "DDPG":
                raise KeyboardInterrupt

    monkeypatch.setattr(module, "contest_trials", watched)
    options: dict[str, Any] = {"trials": 2, "walks": 1, "engine": "pybullet"}
    with pytest.raises(KeyboardInterrupt):
        module.study(comparison, tmp_path / "out", **options)
    states: list[Any] = []
    with reported_to(states.append):
        resumed = module.study(comparison, tmp_path / "out", **options)
    assert states[-1].done == pytest.approx(states[-1].total)
    assert asked[0][:2] == ["PPO", "DDPG"]
    assert asked[1] == asked[0][2:]
    whole = module.study(comparison, tmp_path / "whole", **options)
    assert resumed == whole


@pytest.mark.usefixtures("short")
def test_a_baseline_may_be_trained_on_the_walk_only(compared: Callable[..., Path], tmp_path: Path) -> None:
    walked = Comparison.load(compared(variants=("default", "ddpg", "a2c")))
    rows = {
        key: [row for row in walked.content[key] if row["variant"] != "ddpg" or row["task"] == WALK]
        for key in ("cells", "curves")
    }
    comparison = Comparison(walked.folder, {**walked.content, **rows})
    found = module.study(comparison, tmp_path, trials=1, walks=1, engine="pybullet")
    names = {row["policy"] for row in found["head_to_head"]}
    assert "DDPG" in names
    assert "DDPG, among obstacles" not in names
    untrained = [claim["figure"] for claim in found["claims"] if claim["verdict"] == UNTRAINED]
    assert untrained == ["Fig. 7b", "Fig. 7b", "Fig. 8b", "Fig. 11b"]
    page = (tmp_path / module.PAGE).read_text()
    assert page.count(UNTRAINED) == len(untrained)


def test_a_contest_does_not_depend_on_who_takes_part(compared: Callable[..., Path]) -> None:
    comparison = Comparison.load(compared())
    one, other = (comparison.policies("walk", VARIANTS[name], name) for name in ("PPO", "DDPG"))
    pull = replace(find_scenario("pull-forward"), seconds=1.5)
    options: dict[str, Any] = {"trials": 3, "seed": 5, "engine": "pybullet", "workers": 1}
    contests = {"PPO": (one, [pull]), "DDPG": (other, [pull])}
    found = dict(contest_trials(contests, **options))
    ppo, ddpg = ((policies, found[name]) for name, (policies, _) in contests.items())
    both = head_to_head([ppo, ddpg], [pull.name])
    (alone,) = head_to_head([ddpg], [pull.name], over={"DDPG": "PPO"})
    assert [row["policy"] for row in both] == ["PPO", "DDPG"]
    assert both[1] == alone
    led = head_to_head([ppo, ddpg], [pull.name], over={"DDPG": "PPO"})
    assert led[0] == both[0]
    lost = [row["loss"]["share"] for row in led]
    assert led[1]["lead"]["loss"]["ahead"] == pytest.approx(lost[1] - lost[0], abs=2e-6)
    shares = list[float]()
    (alone_again,) = contest_trials({"DDPG": contests["DDPG"]}, **options, progress=shares.append)
    assert [one.to_json() for one in alone_again[1][pull.name]] == [
        one.to_json() for one in ddpg[1][pull.name]
    ]
    assert sum(shares) == pytest.approx(1.0)


def test_trials_and_rooms_on_another_machine_are_those_of_this_one(
    compared: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing but the tasks goes there, and nothing but the results comes back."""

    class There:
        """As the nodes of a cluster: what comes and goes is pickled, and the last task ends first."""

        shares_disk = False

        def map(self, work: Any, tasks: Any) -> Any:
            sent = [pickle.dumps((work, task)) for task in tasks]
            for index in reversed(range(len(sent))):
                function, task = pickle.loads(sent[index])
                yield index, pickle.loads(pickle.dumps(function(task)))

    comparison = Comparison.load(compared(returns=(0.5, 0.4)))
    one, other = (comparison.policies("walk", VARIANTS[name], name) for name in ("PPO", "DDPG"))
    pull = replace(find_scenario("pull-forward"), seconds=1.0)
    monkeypatch.setattr(contest, "TRIALS_PER_TASK", 2)
    room = replace(find_scenario("room"), seconds=1.0, obstacles=(), route=())
    options: dict[str, Any] = {"trials": 3, "seed": 5, "engine": "pybullet", "workers": 1}
    shares = list[float]()
    there: dict[str, Any] = {**options, "executor": There(), "progress": shares.append}
    contests = {"PPO": (one, [pull]), "DDPG": (other, [pull])}
    away, here = (dict(contest_trials(contests, **where)) for where in (there, options))
    for name in contests:
        both = ([trials.to_json() for trials in found[name]["pull-forward"]] for found in (away, here))
        assert next(both) == next(both)
    assert walks.rooms([one, other], room, **there) == walks.rooms([one, other], room, **options)
    assert sum(shares) == pytest.approx(2.0)


@pytest.mark.slow
def test_a_study_on_a_cluster_is_that_of_one_machine(
    compared: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ray_nodes: RayNodes
) -> None:
    """A node is killed while the trials go on. Figures and page are not drawn."""
    monkeypatch.setattr(module, "find_scenario", cut)
    monkeypatch.setattr(module, "processing_times", times)
    monkeypatch.setattr(module, "drawings", lambda *_: {})
    monkeypatch.setattr(module, "study_page", lambda *_: "")
    pytest.importorskip("kinemimic_native", reason="the native engine is not built here")
    comparison = Comparison.load(compared())
    options: dict[str, Any] = {"trials": 4, "walks": 2, "engine": "native"}
    timer = threading.Timer(4.0, ray_nodes.kill, ["second"])
    timer.start()
    there = module.study(comparison, tmp_path / "there", ray=ray_nodes.cluster.address, **options)
    timer.join()
    here = module.study(comparison, tmp_path / "here", **options)
    assert there["head_to_head"] == here["head_to_head"]
    assert there["rooms"] == here["rooms"]


def test_a_study_of_too_little_is_one_line(compared: Callable[..., Path], tmp_path: Path) -> None:
    folder = compared(variants=("default", "ddpg"))
    with pytest.raises(KinemimicError, match="found incomplete results of a2c on walk"):
        module.study(Comparison.load(folder), tmp_path / "out")
    assert not (tmp_path / "out").exists()
