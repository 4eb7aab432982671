"""A training that was interrupted comes to the same bytes as one that never was; what spoils it leaves a good
checkpoint."""

from __future__ import annotations

import errno
import json
import signal
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from peers.constant import constant
from peers.inline_workers import InlineWorkers
from peers.killing import check_files, finish, kill_after, kill_at_writes, without_clock
from safetensors.numpy import load_file
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from tensorboard.summary.writer import event_file_writer

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import write_text
from kinemimic.retarget.formats.motion_json import motion_to_json
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train import command as stage
from kinemimic.train.config.env_config import DomainRandomization, EnvConfig
from kinemimic.train.config.presets import PRESETS
from kinemimic.train.ppo.ppo import PpoAlgorithm
from kinemimic.train.rollout import evaluation as trial
from kinemimic.train.rollout.policy import POLICY, load_trained
from kinemimic.train.runner import checkpoint
from kinemimic.train.runner import training_loop as rounds
from kinemimic.train.runner.checkpoint import CHECKPOINT
from kinemimic.train.runner.policy_file import PREVIOUS_POLICY
from kinemimic.train.task.env import ACTIONS
from kinemimic.train.task.timer import Timer

# Hardships at their full strength from the beginning: what an episode drew has to come back too.
HARD = EnvConfig(
    episode=11,
    domain_randomization=DomainRandomization(
        push=(20.0, 90.0), rest=(0.05, 0.2), delay=(0.0, 0.02), tilt=0.1, spin=0.2
    ),
)
SMALL = replace(
    PRESETS["default"],
    env=HARD,
    strength=((0, 1.0),),
    num_envs=4,
    horizon=16,
    minibatch=32,
    epochs=2,
    hidden=(32, 16),
)
ROUND = SMALL.batch
# Never corrects anything, explores with noise, under all hardships.
IDLE = (
    constant(),
    np.full(ACTIONS, 0.1, np.float32),
    HARD.reward,
    1.0,
)
BUDGET = 6 * ROUND


@pytest.fixture
def fresh(tmp_path: Path, motion: Motion, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str], Path]]:
    """Makes run folders; trainings are small, with a trial every second round and a checkpoint every one."""
    monkeypatch.setitem(PRESETS, "default", SMALL)
    monkeypatch.setattr(trial, "EVALUATION_INTERVAL", 2 * ROUND)
    monkeypatch.setattr(rounds, "CHECKPOINT_SECONDS", 0.0)
    monkeypatch.setattr(stage, "Workers", InlineWorkers)
    # Files of curves that begin in the same second are read in the order of their names: 10 before 9.
    monkeypatch.setattr(event_file_writer, "_global_uid", event_file_writer.AtomicCounter(0))
    # A job that a shell put into the background has a SIGINT that is ignored.
    earlier = signal.signal(signal.SIGINT, signal.default_int_handler)

    def make(name: str) -> Path:
        write_text(tmp_path / name / "motion.json", motion_to_json(motion))
        return tmp_path / name

    yield make
    signal.signal(signal.SIGINT, earlier)


def in_update(monkeypatch: pytest.MonkeyPatch, number: int, act: Callable[[], object]) -> None:
    """Do something in the midst of the update that has this number, from one."""
    updates, update = iter(range(1, 1000)), PpoAlgorithm.update

    def acting(algorithm: PpoAlgorithm, samples: Any) -> dict[str, float]:
        if next(updates) == number:
            act()
        return update(algorithm, samples)

    monkeypatch.setattr(PpoAlgorithm, "update", acting)


def curves(run: Path) -> dict[str, list[tuple[int, float]]]:
    """TensorBoard's curves, less those of the clock."""
    events = EventAccumulator(str(run / "tensorboard"), size_guidance={"scalars": 0}).Reload()
    return {
        name: [(event.step, event.value) for event in events.Scalars(name)]
        for name in events.Tags()["scalars"]
        if not name.startswith("speed/")
    }


def same_result(run: Path, other: Path) -> None:
    assert (run / "policy.safetensors").read_bytes() == (other / "policy.safetensors").read_bytes()
    assert without_clock(run / "policy.json") == without_clock(other / "policy.json")
    ours, theirs = (load_file(folder / CHECKPOINT) for folder in (run, other))
    assert ours.keys() == theirs.keys()
    assert {name for name in ours if ours[name].tobytes() != theirs[name].tobytes()} == set()
    assert curves(run) == curves(other)


@pytest.mark.parametrize(("number", "stopped"), [(signal.SIGINT, 1), (signal.SIGTERM, 2), (signal.SIGHUP, 1)])
def test_interrupted_and_resumed_it_comes_to_the_same_bytes(
    engine: str, number: int, stopped: int, fresh: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    straight, cut = fresh("straight"), fresh("cut")
    stage.train(straight, budget=BUDGET, workers=2, engine=engine)
    with monkeypatch.context() as patched:
        # After the second round a trial is due, which the resumed training does.
        in_update(patched, stopped, lambda: signal.raise_signal(number))
        with pytest.raises(KeyboardInterrupt, match=f"saved at {stopped * ROUND} samples"):
            stage.train(cut, budget=BUDGET, workers=2, engine=engine)
    assert not (cut / POLICY).exists()
    stage.train(cut, budget=BUDGET, workers=2, engine=engine)
    same_result(straight, cut)


def test_the_best_policy_so_far_is_a_file_from_the_first_evaluation_on(
    engine: str, fresh: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    straight, cut = fresh("straight"), fresh("cut")
    stage.train(straight, budget=BUDGET, workers=2, engine=engine)
    assert json.loads((straight / "policy.json").read_text())["finished"] is True
    with monkeypatch.context() as patched:
        # The evaluation after the second round is done; the third round is the last.
        in_update(patched, 3, lambda: signal.raise_signal(signal.SIGTERM))
        with pytest.raises(KeyboardInterrupt):
            stage.train(cut, budget=BUDGET, workers=2, engine=engine)
    _, policy, record = load_trained(cut)
    assert (record["finished"], record["samples"], record["config"]["budget"]) == (False, 3 * ROUND, BUDGET)
    assert [one["samples"] for one in record["evaluations"]] == [2 * ROUND]
    kept = load_file(cut / CHECKPOINT)
    assert all(np.array_equal(kept[f"best.{name}"], value) for name, value in policy.tensors().items())
    stage.train(cut, budget=BUDGET, workers=2, engine=engine)
    same_result(straight, cut)


def test_a_killed_training_leaves_its_best_policy(
    fresh: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    run = fresh("run")

    class Killed(BaseException):
        pass

    def die() -> None:
        raise Killed

    monkeypatch.setattr(rounds, "CHECKPOINT_SECONDS", 1e9)
    with monkeypatch.context() as patched:
        in_update(patched, 5, die)
        with pytest.raises(Killed):
            stage.train(run, budget=BUDGET, workers=1, engine="pybullet")
    assert not (run / CHECKPOINT).exists()
    record = load_trained(run)[2]
    assert (record["finished"], record["samples"]) == (False, 4 * ROUND)
    # It is of no training that finished, so the next one replaces it.
    stage.train(run, budget=BUDGET, workers=1, engine="pybullet")
    assert load_trained(run)[2]["finished"] is True
    assert not (run / PREVIOUS_POLICY).exists()


def test_another_training_sets_a_finished_policy_aside(fresh: Callable[[str], Path]) -> None:
    run = fresh("run")
    stage.train(run, budget=2 * ROUND, seed=1, workers=1, engine="pybullet")
    first = (run / POLICY).read_bytes()
    # More of the same training is no other training.
    stage.train(run, budget=4 * ROUND, seed=1, workers=1, engine="pybullet")
    assert not (run / PREVIOUS_POLICY).exists()
    before = (run / POLICY).read_bytes(), (run / "policy.json").read_bytes()
    stage.train(run, budget=2 * ROUND, seed=2, workers=1, engine="pybullet")
    aside = run / PREVIOUS_POLICY
    assert (aside.read_bytes(), aside.with_suffix(".json").read_bytes()) == before
    assert (run / POLICY).read_bytes() not in (before[0], first)


def test_a_second_signal_stops_at_once_and_saves_nothing(
    fresh: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    run = fresh("run")

    def twice() -> None:
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)

    in_update(monkeypatch, 1, twice)
    with pytest.raises(KeyboardInterrupt):
        stage.train(run, budget=BUDGET, workers=1, engine="pybullet")
    assert not (run / CHECKPOINT).exists()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_another_number_of_workers_goes_on_with_the_same_figures(motion: Motion) -> None:
    three, two = (InlineWorkers(motion, HARD, 4, seed, count, "pybullet") for seed, count in ((5, 3), (6, 2)))
    three.sample(*IDLE, 7)
    env_states = three.env_states()
    two.set_env_states(env_states)
    back = two.env_states()
    assert back.keys() == env_states.keys()
    assert all(np.array_equal(back[name], env_states[name]) for name in env_states)
    # Workers hold every third and every second figure, and hand in theirs side by side.
    ours, theirs = three.sample(*IDLE, 7).observations, two.sample(*IDLE, 7).observations
    np.testing.assert_array_equal(ours[:, [0, 2, 3, 1]], theirs[:, [0, 2, 1, 3]])


def test_what_is_no_number_stops_it_and_the_good_checkpoint_stays(
    fresh: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    run, straight = fresh("run"), fresh("straight")
    with monkeypatch.context() as patched:
        sample = InlineWorkers.sample
        calls = iter(range(100))

        def spoilt(workers: InlineWorkers, *arguments: Any) -> Any:
            samples = sample(workers, *arguments)
            if next(calls) == 3:  # the first is that of the warming up
                samples.terms[0, 0, 0] = np.nan
            return samples

        patched.setattr(InlineWorkers, "sample", spoilt)
        with pytest.raises(KinemimicError, match=rf"at {2 * ROUND} samples: .* NaN; .*{CHECKPOINT} "):
            stage.train(run, budget=BUDGET, workers=1, engine="pybullet")
    check_files(run)
    stage.train(run, budget=BUDGET, workers=1, engine="pybullet")
    stage.train(straight, budget=BUDGET, workers=1, engine="pybullet")
    same_result(run, straight)


def test_a_spoilt_learner_is_not_saved(tmp_path: Path) -> None:
    path, algorithm = tmp_path / "c.safetensors", PpoAlgorithm(replace(SMALL, hidden=(8, 4)))
    checkpoint.save(path, checkpoint.TrainingState(algorithm), "walk")
    good = path.read_bytes()
    algorithm.net.critic.parameters[0] = np.nan
    with pytest.raises(FloatingPointError, match="infinite or NaN"):
        checkpoint.save(path, checkpoint.TrainingState(algorithm), "walk")
    assert path.read_bytes() == good


def test_a_full_disk_stops_it_with_one_line_and_the_good_checkpoint_stays(
    fresh: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    run, straight = fresh("run"), fresh("straight")
    with monkeypatch.context() as patched:
        save_file, written = checkpoint.save_file, iter(range(100))

        def filling(arrays: Any, path: Path, metadata: dict[str, str]) -> None:
            save_file(arrays, path, metadata)
            if next(written) == 2:
                path.write_bytes(path.read_bytes()[:100])
                raise OSError(errno.ENOSPC, "No space left on device")

        patched.setattr(checkpoint, "save_file", filling)
        with pytest.raises(KinemimicError, match=r"No space left on device.*the previous one is kept"):
            stage.train(run, budget=BUDGET, workers=1, engine="pybullet")
    assert not list(run.glob(".*"))
    check_files(run)
    stage.train(run, budget=BUDGET, workers=1, engine="pybullet")
    stage.train(straight, budget=BUDGET, workers=1, engine="pybullet")
    same_result(run, straight)


def test_seconds_of_all_calls_together_end_it_at_a_round(
    fresh: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    run = fresh("run")
    # A clock that ticks a second whenever it is read.
    ticks = count(0.0, 1.0)
    monkeypatch.setattr(stage, "Timer", lambda: Timer(lambda: next(ticks)))
    first = stage.train(run, budget=BUDGET, minutes=0.2, workers=1, engine="pybullet")
    assert 0 < first["samples"] < BUDGET
    assert first["samples"] % ROUND == 0
    assert first["evaluations"][-1]["samples"] == first["samples"]
    again = stage.train(run, budget=BUDGET, minutes=0.2, workers=1, engine="pybullet")
    assert again["samples"] == first["samples"]
    assert stage.train(run, budget=BUDGET, workers=1, engine="pybullet")["samples"] == BUDGET


def test_killed_at_any_moment_it_goes_on(motion: Motion, tmp_path: Path) -> None:
    kill_and_compare(motion, tmp_path, writes=1)


@pytest.mark.slow
def test_killed_at_any_of_twenty_moments_it_goes_on(motion: Motion, tmp_path: Path) -> None:
    kill_and_compare(motion, tmp_path, writes=5, times=15)


def kill_and_compare(motion: Motion, folder: Path, writes: int, times: int = 0) -> None:
    """A training killed at so many writes, then after so many times."""
    straight, killed = folder / "straight", folder / "killed"
    for run in (straight, killed):
        write_text(run / "motion.json", motion_to_json(motion))
    arguments = ["--budget", "2048", "--workers", "1", "--engine", "pybullet"]
    alone = finish("train", "--run", straight, *arguments)
    random = np.random.default_rng(writes)
    kill_at_writes(writes, alone.writes, random, "train", "--run", killed, *arguments)
    check_files(killed)
    for _ in range(times):
        # Also before the first checkpoint, and after the end.
        kill_after(random.uniform(0.3, 1.1) * alone.seconds, "train", "--run", killed, *arguments)
        check_files(killed)
    finish("train", "--run", killed, *arguments)
    same_result(straight, killed)
