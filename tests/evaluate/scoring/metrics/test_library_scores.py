"""Scores of a tracker on every motion of a library."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from peers.trackers import entry, shipped_motion, write_idle_tracker, write_small_library
from printed.documented import documented_keys

from kinemimic.evaluate.scoring.metrics.library_scores import summaries
from kinemimic.evaluate.scoring.tracker_command import SCORES, evaluate_tracker
from kinemimic.pipeline.cli.main import main
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.retarget.library.library_file import write_library
from kinemimic.retarget.library.motion_library import MotionLibrary
from kinemimic.train.rollout import evaluation


def row(**changes: object) -> dict[str, object]:
    return {
        "name": "one", "subject": "a", "split": "test", "kind": "walk", "cyclic": True,
        "frames": 600.0, "of": 600, "phases": 13, "phases_of": 13, "succeeded": 13, "succeeded_first": True,
        "mpjpe_g_mm": 100.0, "mpjpe_l_mm": 30.0, "vel_mm": 5.0, "acc_mm": 4.0,
        "r2_knee": 0.9, "r2_hip": 0.8, "speed_ratio": 1.0,
    } | changes  # fmt: skip


def test_a_summary_counts_motions_and_rollouts() -> None:
    rows = [
        row(),
        row(phases=12, succeeded=6, succeeded_first=False, frames=300.0, mpjpe_l_mm=50.0, speed_ratio=None),
        row(split="train", kind="run"),
    ]
    walks, runs = summaries(rows)
    assert (walks["split"], walks["kind"], walks["motions"]) == ("test", "walk", 2)
    assert (walks["succeeded"], walks["whole"], walks["frames"]) == (0.5, 0.5, 0.75)
    assert walks["succeeded_phases"] == pytest.approx(19 / 26, abs=1e-4)
    assert (walks["mpjpe_l_mm"], walks["speed_ratio"]) == (40.0, 1.0)
    assert (runs["split"], runs["kind"], runs["whole"]) == ("train", "run", 1.0)


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_small_library(tmp_path_factory.mktemp("library"))


@pytest.fixture
def tracker(tmp_path: Path) -> Path:
    return write_idle_tracker(tmp_path / "tracker")


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two phases; in this process, which knows of it."""
    monkeypatch.setattr(evaluation, "START_PHASES", 2)
    monkeypatch.setattr(evaluation, "CYCLIC_FRAMES", 60)
    monkeypatch.setattr(
        "kinemimic.evaluate.scoring.metrics.library_scores.parallel_map",
        lambda work, tasks, **_: [work(task) for task in tasks],
    )


def test_without_corrections_every_motion_falls(library, tracker, tmp_path, quick) -> None:
    scores = evaluate_tracker(library, str(tracker), tmp_path, engine="pybullet")
    assert json.loads((tmp_path / SCORES).read_text()) == scores
    assert [(one["name"], one["split"]) for one in scores["motions"]] == [
        ("walk", "train"),
        ("run", "train"),
        ("slow", "test"),
    ]
    assert scores["samples"] == 7
    assert documented_keys("tracker_scores.json") == set(scores)
    for one in scores["motions"]:
        assert (one["phases"], one["phases_of"], one["of"]) == (0, 2, 60)
        assert 10 < one["frames"] < 60
        assert 0.0 < one["mpjpe_l_mm"] < one["mpjpe_g_mm"] + 1.0


def test_in_worker_processes(tracker: Path, tmp_path: Path) -> None:
    """Of motions that are performed once, which are short."""
    walk = replace(shipped_motion("walk"), cyclic=False, cycle_offset=np.zeros(3))
    entries = [entry(name, name, "test", walk) for name in ("a", "b", "c")]
    write_library(tmp_path, MotionLibrary.of([walk] * 3, entries), {})
    scores = evaluate_tracker(tmp_path, str(tracker), tmp_path, workers=2, engine="pybullet")
    rows = [{name: value for name, value in row.items() if name not in ("name", "subject")}
            for row in scores["motions"]]  # fmt: skip
    assert rows[0] == rows[1] == rows[2]
    assert (rows[0]["phases_of"], rows[0]["cyclic"]) == (1, False)


def test_one_split_alone(library, tracker, tmp_path, quick) -> None:
    scores = evaluate_tracker(library, str(tracker), tmp_path, split="test", engine="pybullet")
    assert [one["split"] for one in scores["summary"]] == ["test"]


def test_the_command_prints_a_table(library, tracker, tmp_path, quick, capsys) -> None:
    arguments = ["--policy", str(tracker), "--out", str(tmp_path), "--engine", "pybullet", "--workers", "1"]
    with pytest.raises(SystemExit) as exit_:
        main(["evaluate-tracker", str(library), *arguments])
    assert exit_.value.code == 0
    out = capsys.readouterr().out
    assert "MPJPE" in out
    assert str(tmp_path / SCORES) in out.replace("\n", "")


def test_a_policy_of_one_motion_is_no_tracker(library, tmp_path) -> None:
    with pytest.raises(KinemimicError, match=r"walk: expected a tracker, .*, found a policy of one motion"):
        evaluate_tracker(library, "walk", tmp_path)
    with pytest.raises(KinemimicError, match="found 'nobody'"):
        evaluate_tracker(library, "nobody", tmp_path)
