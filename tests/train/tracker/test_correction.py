"""`correct-tracker`: a round corrects, a pause changes no bit, and what is not better is not adopted."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from peers.trackers import entry, shipped_motion

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.retarget.library.library_file import write_library
from kinemimic.retarget.library.motion_library import MotionLibrary
from kinemimic.train.rollout.evaluation import Episode
from kinemimic.train.rollout.tracker_file import load_tracker, tracker_path
from kinemimic.train.tracker import correct_command, correction, lessons, library_control, performance
from kinemimic.train.tracker.correction import correct_tracker


def inline(work: Callable[[Any], Any], tasks: Sequence[Any], *, workers: int) -> list[Any]:
    return [work(task) for task in tasks]


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(correction, "parallel_map", inline)
    monkeypatch.setattr(correction, "LESSONS", 60)
    for module in (correction, lessons):
        monkeypatch.setattr(module, "ENVIRONMENTS", 24)
    monkeypatch.setattr(library_control, "STEPS", 50)
    monkeypatch.setattr(correction, "_CHUNK", 1)
    monkeypatch.setattr(library_control, "ITERATIONS", 3)
    monkeypatch.setattr(library_control, "LONG", 30)
    monkeypatch.setattr(performance, "CYCLIC_FRAMES", 60)


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A walk at two speeds."""
    walk, folder = shipped_motion("walk"), tmp_path_factory.mktemp("library")
    slow = replace(walk, rate=0.95 * walk.rate)
    entries = [entry("walk", "a", "train", walk), entry("slow", "b", "train", slow)]
    write_library(folder, MotionLibrary.of([walk, slow], entries), {})
    return folder


def test_a_round_improves_knees_and_hips_and_a_pause_changes_no_bit(library: Path, tmp_path: Path) -> None:
    record = correct_tracker(library, tmp_path / "once", rounds=2, seed=5)
    correct_tracker(library, tmp_path / "twice", rounds=1, seed=5)
    resumed = correct_tracker(library, tmp_path / "twice", rounds=2, seed=5)
    assert (tmp_path / "once/policy.safetensors").read_bytes() == (
        tmp_path / "twice/policy.safetensors"
    ).read_bytes()
    assert record["corrections"] == resumed["corrections"]
    first, *_ = record["corrections"]
    assert (first["motions"], first["learned"], first["adopted"]) == (2, 2, True)
    path = tracker_path("tracker")
    _, shipped = load_tracker(path)
    assert record["samples"] > shipped["samples"]
    assert record["config"]["start"] == record["provenance"]["inputs"]["policy"]
    assert record["finished"]
    assert len(record["evaluations"]) == len(shipped["evaluations"]) + len(record["corrections"])
    corrected, _ = load_tracker(tmp_path / "once/policy.safetensors")
    assert corrected.shape == load_tracker(path)[0].shape
    assert not (tmp_path / "once/corrections").exists()


def test_an_interrupted_round_goes_on_where_it_was(
    library: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    done: list[int] = []

    def interrupted(work: Callable[[Any], Any], tasks: Sequence[Any], *, workers: int) -> list[Any]:
        if done:
            raise KeyboardInterrupt
        done.append(len(tasks))
        return inline(work, tasks, workers=workers)

    monkeypatch.setattr(correction, "parallel_map", interrupted)
    with pytest.raises(KeyboardInterrupt):
        correct_tracker(library, tmp_path / "out", rounds=1, workers=1)
    (part,) = (tmp_path / "out/corrections").iterdir()
    assert part.name.endswith("-0-0.npz")
    assert not (tmp_path / "out/policy.safetensors").exists()
    done.clear()
    correct_tracker(library, tmp_path / "out", rounds=1, workers=1)
    assert done == [1]  # the other motion alone
    monkeypatch.setattr(correction, "parallel_map", inline)
    correct_tracker(library, tmp_path / "whole", rounds=1, workers=1)
    found, expected = (tmp_path / name / "policy.safetensors" for name in ("out", "whole"))
    assert found.read_bytes() == expected.read_bytes()


def test_a_process_killed_while_it_writes_a_round_does_not_repeat_it(
    library: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = correct_tracker(library, tmp_path / "whole", rounds=1, workers=1)
    replaced = Path.replace

    def killed(path: Path, target: Path) -> Path:
        if target == tmp_path / "out/policy.safetensors":
            raise KeyboardInterrupt
        return replaced(path, target)

    monkeypatch.setattr(Path, "replace", killed)
    with pytest.raises(KeyboardInterrupt):
        correct_tracker(library, tmp_path / "out", rounds=1, workers=1)
    monkeypatch.setattr(Path, "replace", replaced)
    assert (tmp_path / "out/policy.json").exists()
    again = correct_tracker(library, tmp_path / "out", rounds=1, workers=1)
    assert (again["samples"], again["corrections"]) == (whole["samples"], whole["corrections"])
    assert not (tmp_path / "out/corrections").exists()


def test_a_round_that_is_not_better_is_not_adopted(
    library: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fits = iter(3 * [0.9] + 3 * [0.8])

    def perform(*_: object) -> list[Episode]:
        fit = next(fits)
        return [Episode(60, 60, 0.5, fit, fit)]

    monkeypatch.setattr(correction, "perform", perform)
    record = correct_tracker(library, tmp_path, rounds=3)
    assert [(one["r2"], one["adopted"]) for one in record["corrections"]] == [(0.8, False)]
    policy, _ = load_tracker(tmp_path / "policy.safetensors")
    start, shipped = load_tracker(tracker_path("tracker"))
    assert (policy.layers[0][0] == start.layers[0][0]).all()
    assert record["best"] == shipped["best"]
    assert record["finished"]
    # The same command has nothing to do.
    assert correct_tracker(library, tmp_path, rounds=3) == {**record, **_written(tmp_path)}


def _written(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((folder / "policy.json").read_text())
    return found


def test_a_folder_with_another_policy_is_refused(library: Path, tmp_path: Path) -> None:
    correct_tracker(library, tmp_path, rounds=1)
    with pytest.raises(
        KinemimicError, match=r"expected a correction of .* with this seed.*choose another --out"
    ):
        correct_tracker(library, tmp_path, rounds=1, seed=1)


def test_a_library_without_a_loop_is_refused(tmp_path: Path) -> None:
    walk = shipped_motion("walk")
    library = MotionLibrary.of([walk], [entry("walk", "a", "test", walk)])
    write_library(tmp_path / "library", library, {})
    with pytest.raises(KinemimicError, match="expected motions that repeat themselves in the split `train`"):
        correct_tracker(tmp_path / "library", tmp_path / "out")


def test_the_command_says_what_each_round_did(library: Path, tmp_path: Path) -> None:
    done = CliRunner().invoke(
        correct_command.command, [str(library), "--out", str(tmp_path), "--rounds", "1"]
    )
    assert done.exit_code == 0, done.output
    assert "round 1: corrections of 2 of 2 motions, R² of knee and hip 0." in done.output
    assert f"--policy {tmp_path}` performs a capture with it" in done.output


def test_the_adopted_weights_lie_between() -> None:
    start, _ = load_tracker(tracker_path("tracker"))
    learned = replace(start, layers=tuple((2.0 * weight, bias + 4.0) for weight, bias in start.layers))
    found = correction._between(start, learned, 0.75)
    for (weight, bias), (old, offset) in zip(found.layers, start.layers, strict=True):
        np.testing.assert_allclose(weight, 1.75 * old, rtol=1e-6)
        np.testing.assert_allclose(bias, offset + 3.0, rtol=1e-6)
        assert weight.dtype == np.float32
