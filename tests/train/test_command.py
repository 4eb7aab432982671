"""Training as a stage: same seed, same policy; an interrupted run goes on; a bad one says why."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from itertools import count
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from peers.small_training import ROUND, SMALL
from peers.trackers import write_idle_tracker

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import file_hash, read_json, write_text
from kinemimic.retarget.formats.motion_json import motion_to_json
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train import command as stage
from kinemimic.train import settings
from kinemimic.train.config.env_config import EnvConfig
from kinemimic.train.config.from_tracker import from_tracker
from kinemimic.train.config.presets import PRESETS
from kinemimic.train.config.recovery import Recovery
from kinemimic.train.recovery.learning import SEARCHES, Taught
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.rollout.rollout import collect_trajectories
from kinemimic.train.task.timer import Timer


@pytest.fixture
def run(tmp_path: Path, motion: Motion, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setitem(PRESETS, "default", SMALL)
    write_text(tmp_path / "a" / "motion.json", motion_to_json(motion))
    return tmp_path / "a"


def test_same_seed_same_policy_and_same_performance(run: Path, motion: Motion, tmp_path: Path) -> None:
    other = tmp_path / "b"
    other.mkdir()
    (other / "motion.json").write_bytes((run / "motion.json").read_bytes())
    for folder in (run, other):
        stage.train(folder, budget=2 * ROUND, seed=3, workers=2)
    first, second = ((folder / "policy.safetensors").read_bytes() for folder in (run, other))
    assert first == second
    played = [
        collect_trajectories(
            motion,
            Policy.load(folder / "policy.safetensors")[0],
            SMALL.measured_env,
            start_phases=np.array([0.0, 0.5]),
            frames=10,
            workers=2,
        )
        for folder in (run, other)
    ]
    assert played[0].rotations.tobytes() == played[1].rotations.tobytes()
    stage.train(other, budget=2 * ROUND, seed=4, workers=2, resume=False)
    assert (other / "policy.safetensors").read_bytes() != first


def test_goes_on_from_its_checkpoint(run: Path) -> None:
    first = stage.train(run, budget=ROUND, workers=1)
    assert first["samples"] == ROUND
    more = stage.train(run, budget=3 * ROUND, workers=1)
    assert more["samples"] == 3 * ROUND
    before = (run / "policy.safetensors").read_bytes()
    stage.train(run, budget=3 * ROUND, workers=1)
    assert (run / "policy.safetensors").read_bytes() == before
    with pytest.raises(KinemimicError, match="--no-resume"):
        stage.train(run, budget=ROUND, workers=1)


def test_more_workers_than_figures_are_not_started(run: Path) -> None:
    assert stage.train(run, budget=ROUND, workers=SMALL.num_envs + 3)["samples"] == ROUND


def test_another_seed_keeps_the_checkpoint_aside(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    stage.train(run, budget=ROUND, seed=1, workers=1)
    before = (run / "checkpoint.safetensors").read_bytes()
    stage.train(run, budget=ROUND, seed=2, workers=1)
    assert (run / "checkpoint.previous.safetensors").read_bytes() == before
    assert "kept as checkpoint.previous.safetensors; training starts over" in capsys.readouterr().err


def test_the_record_says_which_engine_and_where_the_time_went(run: Path) -> None:
    record = stage.train(run, budget=ROUND, workers=2, engine="pybullet")
    assert json.loads((run / "policy.json").read_text())["engine"] == record["engine"] == "pybullet"
    assert record["exploded"] == 0
    parts = record["seconds_by"]
    assert set(parts) == {
        "simulation", "observation and reward", "inference", "bookkeeping", "transfer and waiting", "update",
        "evaluation", "checkpoint", "other",
    }  # fmt: skip
    # Rounded each for itself.
    assert sum(parts.values()) == pytest.approx(record["seconds"], abs=0.1)


def test_another_engine_goes_on_from_the_checkpoint(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # A clock that ticks a thousand seconds whenever it is read: two rounds took exactly twice what one took.
    ticks = count(0.0, 1000.0)
    monkeypatch.setattr(stage, "Timer", lambda: Timer(lambda: next(ticks)))
    first = stage.train(run, budget=ROUND, workers=1, engine="pybullet")
    more = stage.train(run, budget=2 * ROUND, workers=1, engine="auto")
    assert more["samples"] == 2 * ROUND
    assert first["seconds_by"]["update"] == 1000.0
    assert more["seconds_by"]["update"] == 2000.0
    assert not (run / "checkpoint.previous.safetensors").exists()


@pytest.mark.parametrize(
    ("written", "meant"), [("1e6", 1_000_000), ("4096", 4096), ("500_000", 500_000), ("1", 1)]
)
def test_a_budget_is_written_as_people_write_numbers(
    written: str, meant: int, run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: dict[str, object] = {}

    def stop(_: Path, **options: object) -> None:
        asked.update(options)
        raise KinemimicError("enough")

    monkeypatch.setattr(stage, "train", stop)
    CliRunner().invoke(stage.command, ["--run", str(run), "--budget", written, "--minutes", "2.5"])
    assert (asked["budget"], asked["minutes"]) == (meant, 2.5)


@pytest.mark.parametrize("written", ["0", "-5", "1.5", "nan", "inf", "much"])
def test_what_is_no_budget_is_refused(written: str, run: Path) -> None:
    result = CliRunner().invoke(stage.command, ["--run", str(run), f"--budget={written}"])
    assert result.exit_code == 2
    assert "--budget" in result.output
    assert "expected a whole number of samples" in result.output


def test_an_unknown_engine_is_one_line(run: Path) -> None:
    with pytest.raises(
        KinemimicError, match="expected an engine among auto, native, pybullet, found 'mujoco'"
    ):
        stage.train(run, engine="mujoco")


def test_the_command_ends_with_a_verdict_in_words(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    best = {"samples": 2048, "seconds": 2.0, "strength": 0.0, "frames": 590, "frames_first": 600,
            "of": 600, "reward": 0.5, "knee": 0.91, "hip": 0.92, "robust_return": 0.25,
            "completed": 1, "episodes": 2}  # fmt: skip
    record = {
        "preset": "robust", "engine": "native", "samples": 4096, "exploded": 2, "seconds": 4.0, "seed": 0,
        "mirrored": True, "finished": True,
        "seconds_by": {"simulation": 3.0, "update": 1.0},
        "best": best, "evaluations": [best], "config": PRESETS["default"].to_json(),
        "evaluated_with": {"start_phases": [0.1, 0.6]},
    }  # fmt: skip
    monkeypatch.setattr(stage, "train", lambda *_, **__: record)
    result = CliRunner().invoke(stage.command, ["--run", str(run)], catch_exceptions=False)
    lines = result.output.splitlines()
    assert lines[0] == "falls from 1 of 2 phases, the earliest after 19.7 s (590 of 600 frames)"
    assert lines[1].startswith("best of 1 evaluation, ")
    assert "after 2,048 samples: R² 0.910 knee, 0.920 hip, 50.0 % of the reward, 25.0 % with" in lines[1]
    command = f"kinemimic train --run {run} --preset robust --budget 3M"
    assert lines[2] == f"Train longer: `{command}` (4,096 samples so far)."
    assert lines[3].startswith("2 humanoids exploded")
    assert "4,096 samples in 0:04 (1,024/s), preset robust, seed 0, native engine" in lines[4]
    assert len(lines) == 5
    profiled = CliRunner().invoke(stage.command, ["--run", str(run), "--profile"]).output
    assert "simulation" in profiled and "75.0" in profiled


def test_performance_without_a_policy_is_the_reference_alone(motion: Motion) -> None:
    played = collect_trajectories(
        motion, None, EnvConfig(), start_phases=np.array([0.25]), frames=45, workers=1
    )
    assert played.root.shape == (1, 45, 3)
    # The first frames follow the reference closely; without balance it is on the ground within seconds.
    assert np.abs(played.root[0, 0] - played.reference_root[0, 0]).max() < 0.02
    assert played.fallen_at[0] < 45
    assert np.isfinite(played.rotations).all()
    np.testing.assert_allclose(np.diff(played.phases[0]), 1 / (30 * motion.duration), rtol=1e-9)


def test_what_is_missing_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(KinemimicError, match=r"motion\.json"):
        stage.train(tmp_path)


@pytest.fixture
def tracker(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A tracker that corrects nothing, and rounds of a few samples."""
    quick = {"num_envs": 4, "horizon": 16, "minibatch": 32, "epochs": 2}
    monkeypatch.setattr(settings, "from_tracker", lambda *given: replace(from_tracker(*given), **quick))
    return write_idle_tracker(tmp_path / "tracker")


def test_a_training_starts_from_a_tracker(run: Path, tracker: Path, motion: Motion) -> None:
    record = stage.train(run, start=str(tracker), budget=ROUND, seed=2, workers=1)
    assert (record["preset"], record["seed"], record["samples"]) == ("polish", 2, ROUND)
    assert record["config"]["start"] == file_hash(tracker / "policy.safetensors")
    assert list(record["provenance"]["inputs"]) == ["motion"]
    polished, idle = (Policy.load(folder / "policy.safetensors")[0] for folder in (run, tracker))
    # One round changes the weights a little, and hardly the statistics of ten million samples.
    change = np.abs(polished.layers[-1][1] - idle.layers[-1][1]).max()
    assert 0.0 < change < 0.01
    np.testing.assert_allclose(polished.scale, idle.scale, atol=1e-3)
    # The same start resumes, another one does not.
    assert stage.train(run, start=str(tracker), budget=2 * ROUND, seed=2, workers=1)["samples"] == 2 * ROUND
    stage.train(run, budget=ROUND, seed=2, workers=1)
    assert (run / "checkpoint.previous.safetensors").exists()


def test_what_is_no_tracker_is_no_start(run: Path, tracker: Path) -> None:
    stage.train(run, budget=ROUND, workers=1)
    other = run.with_name("other")
    shutil.copytree(run, other)
    for start, found in (
        ("nobody", "found 'nobody'"),
        (str(other), "expected a tracker, which performs any motion .*, found a policy of one motion"),
        (str(run), "expected a policy outside of .*; train into another run folder"),
    ):
        with pytest.raises(KinemimicError, match=found):
            stage.train(run, start=start, budget=ROUND, workers=1)
    with pytest.raises(KinemimicError, match="expected --preset robust or obstacles, or none, found paper"):
        stage.train(run, start=str(tracker), preset_name="paper", budget=ROUND, workers=1)


def test_a_robust_training_starts_from_a_tracker(run: Path, tracker: Path) -> None:
    record = stage.train(run, start=str(tracker), preset_name="robust", budget=ROUND, seed=1, workers=1)
    assert (record["preset"], record["seed"], record["samples"]) == ("robust-polish", 1, ROUND)
    env, theirs = record["config"]["env"], Policy.load(tracker / "policy.safetensors")[1]["config"]["env"]
    assert env["domain_randomization"]["push"][1] > 0.0
    # The observation stays the tracker's.
    assert env["preview"] == theirs["preview"]
    assert env["tracking"]["leash"] == theirs["tracking"]["leash"]
    assert "robust_return" in record["evaluations"][-1]


def test_recoveries_are_learned_after_the_last_round(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(settings, "LEAST", ROUND)
    quick = Recovery(
        phases=4, directions=(180.0,), forces=(50.0,), candidates=2, elite=1, iterations=1, rounds=1,
        humanoids=6, taught=0.0,
    )  # fmt: skip
    config = replace(SMALL, budget=ROUND, recovery=quick)
    record = stage.train(run, config=config, workers=1)
    assert record["finished"]
    assert record["recovery"]["searches"] == 2
    assert read_json(run / "policy.json")["recovery"] == record["recovery"]
    assert len(read_json(run / SEARCHES)["found"]) == 2
    # Once more, from what is stored: the same policy.
    before = file_hash(run / "policy.safetensors")
    assert stage.train(run, config=config, workers=1)["recovery"] == record["recovery"]
    assert file_hash(run / "policy.safetensors") == before
    # When the training goes on, the policy that was taught is kept until it has ended.
    monkeypatch.setattr(stage, "learn_recoveries", interrupted)
    with pytest.raises(KeyboardInterrupt):
        stage.train(run, config=replace(config, budget=2 * ROUND), workers=1)
    assert file_hash(run / "policy.previous.safetensors") == before
    assert "recovery" not in read_json(run / "policy.json")


def interrupted(*_: object, **__: object) -> Taught:
    raise KeyboardInterrupt


def test_no_recoveries_are_learned_when_the_time_is_up(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(settings, "LEAST", ROUND)
    monkeypatch.setattr(stage, "learn_recoveries", interrupted)
    config = replace(SMALL, budget=3 * ROUND, recovery=Recovery())
    record = stage.train(run, config=config, workers=1, minutes=1e-6)
    assert record["samples"] == ROUND
    assert record["finished"] and "recovery" not in record
