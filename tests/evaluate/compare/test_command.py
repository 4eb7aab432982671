"""The comparison: a cell is what training by hand is, nothing is done twice, and medians are medians."""

from __future__ import annotations

import csv
import json
import signal
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch
from click.testing import CliRunner
from peers.inline_workers import InlineWorkers
from peers.small_training import ROUND, SMALL

from kinemimic.evaluate.compare import command as module
from kinemimic.evaluate.compare.command import compare, increasing
from kinemimic.evaluate.compare.job_runner import Listener
from kinemimic.evaluate.compare.table import summary
from kinemimic.evaluate.compare.task import ComparisonTask
from kinemimic.evaluate.compare.variants import SEARCH
from kinemimic.evaluate.scoring import evaluate as evaluation
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import write_json, write_text
from kinemimic.retarget.formats.motion_json import motion_to_json
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train import command as training
from kinemimic.train.config.presets import PRESETS
from kinemimic.train.rollout import rollout as rollouts


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """All in this process, one after the other; nothing is drawn."""

    def one_by_one(
        work: Callable[[Any], object], tasks: Sequence[Any], jobs: int, listener: Listener[Any]
    ) -> None:
        for task in tasks:
            listener.begun(task)
            error = None
            try:
                work(task)
            except KinemimicError as found:
                error = str(found)
            listener.ended(task, error)

    monkeypatch.setitem(PRESETS, "default", SMALL)
    monkeypatch.setattr(module, "side_by_side", one_by_one)
    monkeypatch.setattr(training, "Workers", InlineWorkers)
    monkeypatch.setattr(rollouts, "parallel_map", lambda work, tasks, **_: [work(task) for task in tasks])
    monkeypatch.setattr(evaluation, "report", lambda *_: "<!doctype html>")
    earlier = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, earlier)


def small_comparison(
    out: Path, *runs: Path, budgets: tuple[int, ...] = (ROUND, 3 * ROUND), seeds: int = 1
) -> Any:
    tasks = [ComparisonTask(run) for run in runs]
    return compare(tasks, {"default": SMALL}, seeds=seeds, budgets=budgets, out=out, engine="pybullet")


def without_seconds(scores: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads(scores.read_text())
    del content["train"]["seconds"]
    return content


@pytest.mark.usefixtures("here")
def test_a_cell_is_what_training_by_hand_is(fresh: Callable[[str], Path], tmp_path: Path) -> None:
    result = small_comparison(tmp_path / "out", fresh("walk"), seeds=2)
    hand, cell = fresh("hand"), tmp_path / "out" / "walk" / "default" / "seed1"
    for budget in (ROUND, 3 * ROUND):
        training.train(hand, seed=1, budget=budget, workers=1, engine="pybullet")
        scores = evaluation.evaluate(hand, workers=1, engine="pybullet")
        assert without_seconds(hand / "scores.json") == without_seconds(cell / f"scores-{budget}.json")
        kept = cell / f"policy-{budget}.safetensors"
        assert kept.read_bytes() == (hand / "policy.safetensors").read_bytes()
        row = next(row for row in result["cells"] if (row["seed"], row["budget"]) == (1, budget))
        assert row["frames"] == scores["survival"]["frames"]
        assert row["samples"] == budget
    assert json.loads((tmp_path / "out" / "compare.json").read_text()) == result
    (curve,) = result["curves"]
    records = [json.loads((cell.parent / f"seed{k}" / "policy.json").read_text()) for k in range(2)]
    for key in ("reward", "critic_loss"):
        assert [row["samples"] for row in curve[key]] == [ROUND, 3 * ROUND]
        last = [record["evaluations"][-1][key] for record in records]
        assert curve[key][-1]["mean"] == pytest.approx(sum(last) / 2)
        assert min(last) <= curve[key][-1]["low"] <= curve[key][-1]["high"] <= max(last)
    assert len(list(csv.DictReader((tmp_path / "out" / "compare.csv").open()))) == 4
    assert str(tmp_path) not in (tmp_path / "out" / "compare.json").read_text()


@pytest.mark.usefixtures("here")
def test_stopped_between_budgets_it_goes_on_and_does_nothing_twice(
    fresh: Callable[[str], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run, straight = fresh("walk"), small_comparison(tmp_path / "straight", fresh("walk"))
    train, budgets = training.train, list[int]()

    def counted(folder: Path, **options: Any) -> Any:
        budgets.append(options["budget"])
        return train(folder, **options)

    monkeypatch.setattr(training, "train", counted)
    with monkeypatch.context() as patched:
        evaluate, calls = evaluation.evaluate, iter(range(9))

        def stopped(folder: Path, **options: Any) -> Any:
            if next(calls) == 1:
                raise KeyboardInterrupt
            return evaluate(folder, **options)

        patched.setattr(evaluation, "evaluate", stopped)
        with pytest.raises(KeyboardInterrupt, match="run the same command again"):
            small_comparison(tmp_path / "cut", run)
    so_far = json.loads((tmp_path / "cut" / "compare.json").read_text())
    assert [row["budget"] for row in so_far["cells"]] == [ROUND]
    result = small_comparison(tmp_path / "cut", run)
    assert budgets == [ROUND, 3 * ROUND, 3 * ROUND]
    for one in (result, straight):
        for row in one["cells"]:
            del row["seconds"], row["first_walk_seconds"]
    assert result["cells"] == straight["cells"]
    small_comparison(tmp_path / "cut", run)
    assert len(budgets) == 3


@pytest.mark.usefixtures("here")
def test_a_cell_that_fails_is_one_line_and_the_others_go_on(
    fresh: Callable[[str], Path], tmp_path: Path
) -> None:
    good, bad = fresh("good"), fresh("bad")
    # Of this the gate knows nothing good: the soles are 90 mm in the ground.
    ranges = {f"{joint}_{side}": [0, 60] for joint in ("knee", "hip") for side in ("left", "right")}
    found = {"kind": "motion", "cyclic": False, "warnings": [], "range_deg": ranges}
    found |= {"ground": {"penetration_m": 0.09}}
    write_json(bad / "gait.json", found)
    arguments = [str(bad), str(good), "--seeds=1", f"--budgets={ROUND}", f"--out={tmp_path / 'out'}"]
    ended = CliRunner().invoke(module.command, [*arguments, "--engine=pybullet"])
    assert ended.exit_code == 1
    told = [line for line in ended.stderr.splitlines() if line.startswith("bad default seed 0: ")]
    assert len(told) == 1
    assert "penetrate the ground by 90 mm" in told[0]
    result = json.loads((tmp_path / "out" / "compare.json").read_text())
    assert list(result["failed"]) == ["bad default seed 0"]
    assert [row["task"] for row in result["cells"]] == ["good"]
    assert "good, SIMULATED CAPTURE, 64 samples" in ended.stdout


@pytest.mark.usefixtures("here")
def test_results_of_something_else_are_left_alone(
    fresh: Callable[[str], Path], tmp_path: Path, walk: Motion
) -> None:
    run, out = fresh("walk"), tmp_path / "out"
    small_comparison(out, run, budgets=(ROUND,))
    before = (out / "walk" / "default" / "seed0" / f"scores-{ROUND}.json").read_bytes()
    changed = {"default": replace(SMALL, discount=0.9)}
    other = compare([ComparisonTask(run)], changed, seeds=1, budgets=[ROUND], out=out, engine="pybullet")
    assert "of the same settings, found another" in other["failed"]["walk default seed 0"]
    record = out / "walk" / "default" / "seed0" / f"policy-{ROUND}.json"
    mine = record.read_text()
    record.write_text(mine.replace('"engine": "pybullet"', '"engine": "native"'))
    elsewhere = small_comparison(out, run, budgets=(ROUND,))
    assert "of the same engine, found another" in elsewhere["failed"]["walk default seed 0"]
    record.write_text(mine)
    earlier = small_comparison(out, run, budgets=(ROUND // 2, ROUND))
    assert "training cannot go back" in earlier["failed"]["walk default seed 0"]
    write_text(run / "motion.json", motion_to_json(walk))
    with pytest.raises(KinemimicError, match="on the same motions, found another walk"):
        small_comparison(out, run)
    assert (out / "walk" / "default" / "seed0" / f"scores-{ROUND}.json").read_bytes() == before


def test_medians_are_of_the_seeds_that_have_the_figure() -> None:
    key = {"task": "walk", "variant": "default", "budget": 10, "engine": "native"}
    cells = [
        key | {"seed": 0, "frames": 600, "first_walk_samples": None},
        key | {"seed": 1, "frames": 100, "first_walk_samples": 7},
        key | {"seed": 2, "frames": 590, "first_walk_samples": 8},
        key | {"seed": 0, "budget": 20, "frames": 600, "first_walk_samples": None},
    ]
    first, second = summary(cells)
    assert (first["seeds"], second["seeds"]) == (3, 1)
    assert first["metrics"]["frames"] == {"median": 590, "min": 100, "max": 600, "n": 3}
    assert first["metrics"]["first_walk_samples"] == {"median": 7.5, "min": 7, "max": 8, "n": 2}
    assert second["metrics"]["first_walk_samples"] == {
        "median": None,
        "min": None,
        "max": None,
        "n": 0,
    }


@pytest.mark.usefixtures("here")
def test_a_search_is_a_comparison(
    fresh: Callable[[str], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    small = replace(PRESETS["a2c"], num_envs=4, horizon=16)
    monkeypatch.setitem(PRESETS, "a2c", small)
    changes = {"relu": {"baseline": {"activation": "relu"}}, "steps-8": {"baseline": {"n_steps": 8}}}
    monkeypatch.setitem(SEARCH, "a2c", changes)
    arguments = [str(fresh("walk")), "--search=a2c", "--seeds=1", f"--budgets={ROUND}", "--hidden=32,16"]
    arguments += ["--hidden=a2c-relu=16", "--only=a2c-relu", "--preset=a2c"]
    ended = CliRunner().invoke(
        module.command, [*arguments, f"--out={tmp_path / 'out'}", "--engine=pybullet", "--json"]
    )
    assert ended.exit_code == 0, ended.output
    result = json.loads((tmp_path / "out" / "compare.json").read_text())
    assert [row["variant"] for row in result["cells"]] == ["a2c", "a2c-relu"]
    layers = {name: one["hidden"] for name, one in result["provenance"]["config"]["variants"].items()}
    assert layers == {"a2c": [32, 16], "a2c-relu": [16]}
    assert result["failed"] == {}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "Missing argument 'RUN[@SCENARIO]...'"),
        (["nowhere"], "motion.json: expected a file, found none"),
        (["nowhere", "--budgets=1e6,much"], "expected a whole number of samples"),
        (["nowhere", "--preset=best"], "'best' is not one of"),
        (["nowhere", "--search=default"], "'default' is not one of"),
        (["nowhere", "--seeds=0"], "--seeds"),
        (["nowhere", "--seeds=99999999999999999999999"], "is not in the range 1<=x<=1000"),
        (["nowhere", "--limit=ddpg"], "expected VARIANT=SAMPLES, found 'ddpg'"),
        (["nowhere", "--limit=ddpg=3e5"], "--limit: expected some of default, found 'ddpg'"),
        (["nowhere", "--search=ddpg", "--only=ddpg-much"], "found 'ddpg-much'"),
        (["nowhere", "--hidden=128,much"], "expected sizes such as 128,64, found '128,much'"),
        (["nowhere", "--hidden=0"], "for '--hidden': expected sizes such as 128,64, found '0'"),
        (["nowhere", "--hidden=ddpg=8"], "--hidden: expected some of default, found 'ddpg'"),
        (["nowhere", "--hidden=128", "--ablation"], "expected no --ablation"),
        (["a/walk", "b/walk"], "found walk, walk"),
        (["a/walk", "--ray", "--device=cuda"], "--device: expected cpu with --ray"),
        (["a/walk", "--device=cuda"], "--device cuda: expected DDPG, TD3 or SAC, found default"),
    ],
)
def test_what_is_wrong_is_one_line(
    arguments: list[str], message: str, fresh: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    fresh("a/walk")
    monkeypatch.chdir(fresh("b/walk").parents[1])
    ended = CliRunner().invoke(module.command, arguments)
    assert ended.exit_code != 0
    assert message in (str(ended.exception) if isinstance(ended.exception, KinemimicError) else ended.output)
    assert not Path("runs").exists()


@pytest.mark.skipif(torch.cuda.is_available(), reason="there is a GPU")
def test_a_gpu_that_is_not_there_is_refused_before_anything_is_written(
    fresh: Callable[[str], Path], tmp_path: Path
) -> None:
    task, out = ComparisonTask(fresh("walk")), tmp_path / "out"
    with pytest.raises(KinemimicError, match=r"--device cuda: expected a GPU .* found none"):
        compare([task], {"sac": PRESETS["sac"]}, seeds=1, budgets=(ROUND,), out=out, device="cuda")
    assert not out.exists()


def test_budgets_increase() -> None:
    assert increasing("2e6,1e6,1_000_000") == (1_000_000, 2_000_000)


@pytest.mark.usefixtures("here")
def test_a_limit_ends_one_variant_sooner(fresh: Callable[[str], Path], tmp_path: Path) -> None:
    variants = {"default": SMALL, "other": replace(SMALL, preset="other", discount=0.9)}
    options: dict[str, Any] = {"seeds": 1, "budgets": (ROUND, 2 * ROUND), "engine": "pybullet"}
    task = ComparisonTask(fresh("walk"))
    result = compare([task], variants, limits={"other": ROUND}, out=tmp_path / "out", **options)
    assert [(row["variant"], row["budget"]) for row in result["cells"]] == [
        ("default", ROUND),
        ("default", 2 * ROUND),
        ("other", ROUND),
    ]
    with pytest.raises(KinemimicError, match="--limit other: expected one of the budgets, 64, 128 samples"):
        compare([task], variants, limits={"other": ROUND - 1}, out=tmp_path / "none", **options)
