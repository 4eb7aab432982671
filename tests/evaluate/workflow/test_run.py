"""kinemimic run: stages that are repeated or skipped, and equal results for equal seeds."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from peers.trackers import shipped_motion

from kinemimic.evaluate.workflow import run as module
from kinemimic.evaluate.workflow.run import RUN_STAGES, run
from kinemimic.evaluate.workflow.start import default_start
from kinemimic.pipeline.cli.main import load_command
from kinemimic.pipeline.convert import convert
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.stages import VIRTUAL_CAPTURE
from kinemimic.pipeline.files.store import read_json
from kinemimic.pipeline.ingest import ingest
from kinemimic.pipeline.virtual_kinect.recorder import record_virtual
from kinemimic.retarget.command import retarget
from kinemimic.retarget.formats.motion_json import motion_to_json
from kinemimic.retarget.library.exercises import exercise

NAMES = RUN_STAGES

Stages = dict[str, Callable[[], None]]


def test_a_second_run_skips_every_stage(stages: Stages, capture: Path, tmp_path: Path) -> None:
    assert run(capture, tmp_path / "run").ran == NAMES
    again = run(capture, tmp_path / "run")
    assert again.ran == ()
    assert again.skipped == NAMES


def arguments_of_training(folder: Path) -> list[str]:
    found: list[str] = json.loads((folder / "policy.json").read_text())[3]
    return found


@pytest.mark.parametrize(
    ("options", "scratch", "found"),
    [
        ({}, False, ["--from=tracker"]),
        ({"budget": "300k"}, False, ["--budget=300k", "--from=tracker"]),
        ({"budget": "300k"}, True, ["--budget=300k"]),
        ({"preset": "robust"}, False, ["--preset=robust"]),
        ({"from": "standing"}, False, ["--from=standing"]),
    ],
)
def test_a_training_starts_from_the_tracker_unless_told_otherwise(
    stages: Stages,
    monkeypatch: pytest.MonkeyPatch,
    capture: Path,
    tmp_path: Path,
    options: dict[str, str],
    scratch: bool,
    found: list[str],
) -> None:
    monkeypatch.setattr(module, "default_start", lambda _: {"from": "tracker"})
    folder = tmp_path / "run"
    run(capture, folder, options={"train": options}, from_scratch=scratch)
    assert arguments_of_training(folder) == found
    assert run(capture, folder, options={"train": options}, from_scratch=scratch).ran == ()
    # The other kind of start is another training.
    if not options.keys() & {"preset", "from"}:
        ran = run(capture, folder, options={"train": options}, from_scratch=not scratch).ran
        assert ran == ("train", "evaluate", "view")


def test_gaits_start_from_the_tracker_and_exercises_from_the_standing_one(tmp_path: Path) -> None:
    walk = shipped_motion("walk")
    sunk = walk.root - [0.0, 0.0, 0.6]
    for motion, found in (
        (walk, {"from": "tracker"}),
        (replace(walk, cyclic=False, cycle_offset=np.zeros(3)), {}),
        (replace(walk, root=sunk), {}),
        (exercise(0, 0), {"from": "standing"}),
    ):
        (tmp_path / "motion.json").write_text(motion_to_json(motion))
        assert default_start(tmp_path) == found


def test_a_policy_that_performs_is_not_trained(capture: Path, tmp_path: Path) -> None:
    with pytest.raises(KinemimicError, match="expected no --from-scratch"):
        run(capture, tmp_path / "run", policy="tracker", from_scratch=True)


def test_a_changed_capture_reruns_every_stage(stages: Stages, capture: Path, tmp_path: Path) -> None:
    run(capture, tmp_path / "run")
    capture.write_text("another walk")
    assert run(capture, tmp_path / "run", overwrite=True).ran == NAMES


def test_a_new_truth_file_reruns_every_stage(stages: Stages, capture: Path, tmp_path: Path) -> None:
    run(capture, tmp_path / "run")
    capture.with_suffix(".truth.parquet").write_text("truth")
    assert run(capture, tmp_path / "run").ran == NAMES


def test_a_changed_sidecar_file_of_the_capture_counts(stages: Stages, capture: Path, tmp_path: Path) -> None:
    # The stand-in of `ingest` says that it read a description of the columns beside the capture.
    description = capture.with_name("capture.toml")
    description.write_text("unit = 'm'")
    run(capture, tmp_path / "run")
    assert run(capture, tmp_path / "run").ran == ()
    description.write_text("unit = 'mm'")
    assert run(capture, tmp_path / "run").ran == NAMES


def test_a_changed_file_of_a_capture_that_is_a_folder_counts(stages: Stages, tmp_path: Path) -> None:
    folder = tmp_path / "recording"
    (folder / "depth").mkdir(parents=True)
    (folder / "depth" / "000000.png").write_text("a frame")
    assert run(folder, tmp_path / "run").ran == NAMES
    assert run(folder, tmp_path / "run").ran == ()
    (folder / "depth" / "000000.png").write_text("another frame")
    assert run(folder, tmp_path / "run", overwrite=True).ran == NAMES


def test_a_tracker_performs_without_a_training(stages: Stages, capture: Path, tmp_path: Path) -> None:
    without = tuple(name for name in NAMES if name != "train")
    assert run(capture, tmp_path / "run", policy="tracker").ran == without
    assert run(capture, tmp_path / "run", policy="tracker").ran == ()
    arguments = json.loads((tmp_path / "run/scores.json").read_text())[3]
    assert "--policy=tracker" in arguments
    # A training later replaces it, on the motion as retargeted for a training.
    assert run(capture, tmp_path / "run").ran[0] == "retarget"


def test_only_a_tracker_gets_a_balanced_walk(stages: Stages, capture: Path, tmp_path: Path) -> None:
    def flags(folder: Path) -> list[str]:
        arguments: list[str] = json.loads((folder / "motion.json").read_text())[3]
        return [one for one in arguments if "balance" in one]

    run(capture, tmp_path / "trained")
    run(capture, tmp_path / "performed", policy="tracker")
    chosen = {"retarget": {"no-balance": True}}
    run(capture, tmp_path / "as-it-is", policy="tracker", options=chosen)
    assert flags(tmp_path / "trained") == []
    assert flags(tmp_path / "performed") == ["--balance"]
    assert flags(tmp_path / "as-it-is") == ["--no-balance"]


def test_a_changed_option_reruns_its_stage_and_all_later_ones(
    stages: Stages, capture: Path, tmp_path: Path
) -> None:
    run(capture, tmp_path / "run", options={"train": {"seed": 1}})
    outcome = run(capture, tmp_path / "run", options={"train": {"seed": 2}})
    assert outcome.skipped == ("ingest", "convert", "retarget")
    assert outcome.ran == ("train", "evaluate", "view")


def test_a_missing_output_reruns_its_stage_and_all_later_ones(
    stages: Stages, capture: Path, tmp_path: Path
) -> None:
    run(capture, tmp_path / "run")
    (tmp_path / "run" / "curves.csv").unlink()
    assert run(capture, tmp_path / "run").ran == ("evaluate", "view")


@pytest.mark.parametrize("error", [KeyboardInterrupt(), KinemimicError("no ground")])
def test_an_interrupted_run_resumes(
    error: BaseException, stages: Stages, capture: Path, tmp_path: Path
) -> None:
    def fail() -> None:
        raise error

    stages["train"] = fail
    with pytest.raises(type(error)):
        run(capture, tmp_path / "run")
    del stages["train"]
    outcome = run(capture, tmp_path / "run")
    assert outcome.skipped == ("ingest", "convert", "retarget")
    assert outcome.ran == ("train", "evaluate", "view")


def test_options_reach_their_stage_and_no_other(stages: Stages, capture: Path, tmp_path: Path) -> None:
    options = {"train": {"seed": 5, "budget": None}}
    run(capture, tmp_path, options=options)
    assert "--seed=5" in (tmp_path / "policy.json").read_text()
    assert "--budget" not in (tmp_path / "policy.json").read_text()
    assert "--seed=5" not in (tmp_path / "gimbal.json").read_text()


def test_json_prints_json_alone(stages: Stages, capture: Path, tmp_path: Path) -> None:
    result = CliRunner().invoke(module.command, [str(capture), "--run", str(tmp_path / "run"), "--json"])
    assert result.exit_code == 0, result.output
    printed = json.loads(result.output)
    assert printed["ran"] == list(NAMES)
    assert printed["scores"] == read_json(tmp_path / "run" / "scores.json")


@pytest.mark.parametrize(
    ("flags", "stage", "file"),
    [
        (["--filter", "none"], "ingest", "raw.parquet"),
        (["--unit", "cm"], "ingest", "raw.parquet"),
        (["--rate", "30.0"], "ingest", "raw.parquet"),
        (["--ankle", "normal"], "retarget", "motion.json"),
        (["--no-refine"], "retarget", "motion.json"),
        (["--loop"], "retarget", "motion.json"),
        (["--symmetric"], "retarget", "motion.json"),
        (["--as-recorded"], "retarget", "motion.json"),
        (["--no-loop"], "retarget", "motion.json"),
        (["--engine", "pybullet"], "train", "policy.json"),
        (["--workers", "1"], "train", "policy.json"),
        (["--anyway"], "train", "policy.json"),
    ],
)
def test_a_flag_reaches_its_stage_and_reruns_it_and_all_later_ones(
    stages: Stages, capture: Path, tmp_path: Path, flags: list[str], stage: str, file: str
) -> None:
    arguments = [str(capture), "--run", str(tmp_path), "--json"]
    CliRunner().invoke(module.command, arguments, catch_exceptions=False)
    again = CliRunner().invoke(module.command, [*arguments, *flags], catch_exceptions=False)
    assert json.loads(again.output)["ran"] == list(NAMES[NAMES.index(stage) :])
    assert "=".join(flags) in (tmp_path / file).read_text()
    same = CliRunner().invoke(module.command, [*arguments, *flags], catch_exceptions=False)
    assert json.loads(same.output)["ran"] == []
    # The real command must know the options that the stand-ins accept.
    names = {name for option in load_command(stage).params for name in (*option.opts, *option.secondary_opts)}
    assert flags[0] in names


def test_the_same_seed_gives_the_same_bytes(tmp_path: Path) -> None:
    files = ("quality.json", "gimbal.json", "gait.json", "motion.json")
    written = []
    for folder in (tmp_path / "one", tmp_path / "two"):
        capture = record_virtual(folder / "capture", seed=4).euler
        ingest(capture, folder)
        convert(folder)
        retarget(folder)
        written.append({name: (folder / name).read_bytes() for name in files})
    assert written[0] == written[1]


def without_clock(scores: dict[str, Any]) -> dict[str, Any]:
    """Scores less what a clock says of the training; the policy's hash stays."""
    train = {key: value for key, value in scores["train"].items() if key != "seconds"}
    return {**scores, "train": train}


@pytest.mark.slow
def test_two_runs_with_the_same_seed_agree(tmp_path: Path) -> None:
    arguments = ["--budget", "2000", "--seed", "3", "--json"]
    results = [
        CliRunner().invoke(module.command, ["--run", str(tmp_path / name), *arguments])
        for name in ("one", "two")
    ]
    assert [result.exit_code for result in results] == [0, 0]
    one, two = (json.loads(result.stdout) for result in results)
    assert one["ran"] == ["virtual", *NAMES]
    assert one["scores"]["capture"]["simulated"] is True
    assert (tmp_path / "one" / VIRTUAL_CAPTURE).is_file()
    for name in ("report.html", "view.rrd", "motion.mcap", "curves.csv"):
        assert (tmp_path / "one" / name).stat().st_size > 0
    assert without_clock(one["scores"]) == without_clock(two["scores"])
    motions = [(tmp_path / name / "motion.json").read_bytes() for name in ("one", "two")]
    assert motions[0] == motions[1]
