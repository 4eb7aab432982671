"""Checkpoints: the learner comes back whole; those of something else, and damaged ones, are named."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from safetensors import safe_open
from safetensors.numpy import load_file, save_file

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.ppo.networks import export
from kinemimic.train.ppo.ppo import PpoAlgorithm
from kinemimic.train.rollout.evaluation import Evaluation
from kinemimic.train.runner import checkpoint
from kinemimic.train.runner.checkpoint import TrainingState
from kinemimic.train.sampling.sampler import Samples
from kinemimic.train.task.env import ACTIONS
from kinemimic.train.task.observation import OBSERVATIONS


def samples_of(seed: int) -> Samples:
    """Samples of 3 steps of 4 environments that mean nothing."""
    random = np.random.default_rng(seed)
    return Samples(
        observations=random.normal(size=(3, 4, OBSERVATIONS)).astype(np.float32),
        actions=random.normal(0, 0.1, (3, 4, ACTIONS)).astype(np.float32),
        terms=random.random((3, 4, 5)).astype(np.float32),
        terminated=random.random((3, 4)) < 0.2,
        truncated=np.zeros((3, 4), dtype=bool),
        next_observations=random.normal(size=(3, 4, OBSERVATIONS)).astype(np.float32),
        episode_lengths=np.array([2]),
        exploded=0,
    )


def test_a_checkpoint_brings_the_learner_back_whole(tmp_path: Path) -> None:
    """One more update after the restoration gives what it gives without: nothing was forgotten."""
    config = TrainConfig(hidden=(8, 4), seed=5, minibatch=6, epochs=2, num_envs=4)
    algorithm = PpoAlgorithm(config)
    algorithm.update(samples_of(0))
    tried = Evaluation(64, 0.5, 1.0, frames=3, frames_first=4, of=5, reward=0.25, knee=0.5, hip=-2.0)
    policy = export(algorithm.net, algorithm.normalizer)
    training = TrainingState(algorithm, {"ages": np.arange(4)}, [tried], policy)
    checkpoint.save(tmp_path / "c.safetensors", training, "walk")
    other = PpoAlgorithm(config)
    back = TrainingState(other)
    assert checkpoint.restore(tmp_path / "c.safetensors", back, "walk")
    assert back.evaluations == [tried]
    assert back.env_states is not None
    assert back.best is not None
    assert back.env_states["ages"].tolist() == [0, 1, 2, 3]
    assert training.best is not None
    kept, ours = back.best.tensors(), training.best.tensors()
    assert all(np.array_equal(kept[name], ours[name]) for name in ours)
    assert other.progress == algorithm.progress
    assert algorithm.update(samples_of(1)) == other.update(samples_of(1))
    wanted, found = algorithm.tensors(), other.tensors()
    assert wanted.keys() == found.keys()
    assert all(bool((wanted[name] == found[name]).all()) for name in wanted)


def test_a_checkpoint_of_something_else_is_left_alone(tmp_path: Path) -> None:
    config = TrainConfig(hidden=(8, 4))
    path = tmp_path / "c.safetensors"
    checkpoint.save(path, TrainingState(PpoAlgorithm(config)), "walk")
    assert not checkpoint.restore(path, TrainingState(PpoAlgorithm(config)), "run")
    assert not checkpoint.restore(path, TrainingState(PpoAlgorithm(replace(config, discount=0.9))), "walk")
    assert checkpoint.restore(path, TrainingState(PpoAlgorithm(replace(config, budget=5))), "walk")


def test_a_file_that_is_no_checkpoint_is_one_line(tmp_path: Path) -> None:
    path, training = tmp_path / "c.safetensors", TrainingState(PpoAlgorithm(TrainConfig(hidden=(8, 4))))
    path.write_bytes(b"nonsense")
    with pytest.raises(KinemimicError, match="expected a checkpoint"):
        checkpoint.restore(path, training, "walk")
    other = {"schema": checkpoint.CHECKPOINT_SCHEMA, "motion": "walk", "config": {}, "evaluations": [{}]}
    for said in ("{}", "[1]", "{", "[" * 100_000, json.dumps(other)):
        save_file({"mean": np.zeros(3)}, path, {"kinemimic": said})
        with pytest.raises(KinemimicError, match=r"expected (a checkpoint|a whole number)"):
            checkpoint.restore(path, training, "walk")


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Arrays and record of a checkpoint after a round, with a trial."""
    algorithm = PpoAlgorithm(TrainConfig(hidden=(8, 4), minibatch=6, epochs=2))
    algorithm.update(samples_of(0))
    env_states = {"ages": np.zeros(64, np.int64)}
    trial = Evaluation(6, 1.0, 0.0, 10, 10, 10, 0.5, 0.9, 0.9)
    path = tmp_path_factory.mktemp("trained") / "c.safetensors"
    checkpoint.save(path, TrainingState(algorithm, env_states, [trial], algorithm.policy()), "walk")
    with safe_open(path, framework="np") as stream:
        return load_file(path), json.loads(stream.metadata()["kinemimic"])


DAMAGED: dict[str, Callable[[dict[str, Any], dict[str, Any]], object]] = {
    "no actor": lambda a, r: a.pop("algorithm.actor"),
    "no normaliser": lambda a, r: a.pop("algorithm.normalizer.mean"),
    "no mean of the best": lambda a, r: a.pop("best.mean"),
    "another actor": lambda a, r: a.update({"algorithm.actor": np.zeros(3, np.float32)}),
    "a broad actor": lambda a, r: a.update({"algorithm.actor": np.zeros(1, np.float32)}),
    "another type": lambda a, r: a.update({"algorithm.actor": a["algorithm.actor"].astype(np.float64)}),
    "another slot": lambda a, r: a.update({"algorithm.optimizer.actor.0.exp_avg": np.zeros(3, np.float32)}),
    "another best": lambda a, r: a.update({"best.mean": np.zeros(3, np.float32)}),
    "other environments": lambda a, r: a.update({"env_states.ages": np.zeros(3, np.int64)}),
    "no progress": lambda a, r: r.pop("progress"),
    "samples in words": lambda a, r: r["progress"].update(samples="x"),
    "no random": lambda a, r: r.update(random={}),
    "a list for settings": lambda a, r: r.update(config=[]),
    "a number for evaluations": lambda a, r: r.update(evaluations=5),
    "an evaluation in words": lambda a, r: r["evaluations"][0].update(reward="x"),
}


@pytest.mark.parametrize("name", DAMAGED)
def test_a_damaged_checkpoint_is_one_clear_line(tmp_path: Path, trained, name: str) -> None:
    arrays, record = copy.deepcopy(trained)
    path = tmp_path / "c.safetensors"
    algorithm = PpoAlgorithm(TrainConfig(hidden=(8, 4), minibatch=6, epochs=2))
    save_file(arrays, path, {"kinemimic": json.dumps(record)})
    assert checkpoint.restore(path, TrainingState(algorithm), "walk")
    DAMAGED[name](arrays, record)
    save_file(arrays, path, {"kinemimic": json.dumps(record)})
    with pytest.raises(
        KinemimicError,
        match=r"c\.safetensors(, key [a-z].*)?: expected .*, found .*; another advice$",
    ):
        checkpoint.restore(path, TrainingState(algorithm), "walk", advice="another advice")
