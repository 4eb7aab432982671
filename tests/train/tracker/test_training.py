"""Training a tracker: resumed to the last bit, for the library and the settings that it began with."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from peers.inline_workers import InlinePool
from peers.ray_nodes import RayNodes, node_of
from peers.trackers import entry, shipped_motion, write_small_library
from safetensors import safe_open
from safetensors.numpy import load

from kinemimic.pipeline.cli.progress import reported_to
from kinemimic.pipeline.cli.progress_state import ProgressState
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.retarget.library.exercises import exercise
from kinemimic.retarget.library.library_file import write_library
from kinemimic.retarget.library.motion_library import MotionLibrary
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.tracker import tracker_config
from kinemimic.train.ppo.ppo import PpoAlgorithm
from kinemimic.train.rollout.policy import Policy, is_tracker
from kinemimic.train.sampling.sampler import Samples
from kinemimic.train.tracker import command, performance, runner
from kinemimic.train.tracker.command import train_tracker
from kinemimic.train.tracker.sampler import TrackerSampler

CONFIG = replace(
    tracker_config(), hidden=(16, 8), num_envs=6, horizon=8, minibatch=24, epochs=2, budget=192,
    strength=((0, 1.0),),
)  # fmt: skip
ROUND = CONFIG.batch


class InlineWorkers(runner.TrackerWorkers):
    """Workers without processes."""

    def __init__(self, tables: Path, config: TrainConfig, count: int, engine: str, open_pool: Any) -> None:
        super().__init__(tables, config, count, engine, InlinePool)


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(command, "TrackerWorkers", InlineWorkers)
    monkeypatch.setattr(runner, "EVALUATION_INTERVAL", 2 * ROUND)
    monkeypatch.setattr(performance, "CYCLIC_FRAMES", 20)


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_small_library(tmp_path_factory.mktemp("library"))


def bytes_of(folder: Path) -> dict[str, bytes]:
    return {name: (folder / name).read_bytes() for name in ("policy.safetensors", "checkpoint.safetensors")}


def test_the_standing_preset_trains_on_motions_without_strides(
    library: Path, tmp_path: Path, quick: None
) -> None:
    config = replace(CONFIG, preset="standing", budget=ROUND)
    with pytest.raises(KinemimicError, match=r"expected motions without strides to train on, .* --exercises"):
        train_tracker(library, tmp_path / "none", config=config, workers=1, engine="pybullet")
    still = exercise(0, 0)
    walk = shipped_motion("walk")
    entries = [entry("walk", "a", "train", walk), entry("still", "b", "train", still, "motion")]
    write_library(tmp_path / "both", MotionLibrary.of([walk, still], entries), {})
    train_tracker(tmp_path / "both", tmp_path / "run", config=config, workers=1, engine="pybullet")
    assert np.load(tmp_path / "run/references/durations.npy").tolist() == pytest.approx([still.duration])


def test_a_pause_does_not_change_a_bit(library: Path, tmp_path: Path, quick: None) -> None:
    """The checkpoint has wall times, so only arrays are compared there."""
    at_once = train_tracker(library, tmp_path / "once", config=CONFIG, workers=2, engine="pybullet")
    train_tracker(library, tmp_path / "twice", config=CONFIG, budget=2 * ROUND, workers=2, engine="pybullet")
    resumed = train_tracker(library, tmp_path / "twice", config=CONFIG, workers=2, engine="pybullet")
    assert at_once["samples"] == resumed["samples"] == 192
    once, twice = bytes_of(tmp_path / "once"), bytes_of(tmp_path / "twice")
    assert once["policy.safetensors"] == twice["policy.safetensors"]
    first, second = load(once["checkpoint.safetensors"]), load(twice["checkpoint.safetensors"])
    assert first.keys() == second.keys()
    for name, array in first.items():
        np.testing.assert_array_equal(array, second[name], err_msg=name)
    assert first["algorithm.failures"].shape == first["algorithm.lengths"].shape == (2,)
    assert set(first["env_states.motions"]) <= {0, 1}


@pytest.mark.slow
def test_actors_train_the_tracker_that_processes_train(
    library: Path, tmp_path: Path, ray_nodes: RayNodes, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two of each; after the tenth round, the node of an actor is killed, and nothing shows it."""
    pytest.importorskip("kinemimic_native", reason="the native engine is not built here")
    options: dict[str, Any] = {"config": replace(CONFIG, budget=40 * ROUND), "workers": 2, "engine": "native"}
    pools, killed = list[Any](), list[str]()

    class Noted(runner.TrackerWorkers):
        def __init__(self, *arguments: Any) -> None:
            super().__init__(*arguments)
            pools.append(self._pool)

    def kill_one(state: ProgressState) -> None:
        if state.what == "train" and state.done == 10 * ROUND:
            there = [node_of(seat.actor) for seat in pools[0]._seats]
            killed.extend(name for name, node in ray_nodes.nodes.items() if node.node_id in there)
            ray_nodes.kill(killed[-1])

    with monkeypatch.context() as patched, reported_to(kill_one):
        patched.setattr(command, "TrackerWorkers", Noted)
        train_tracker(library, tmp_path / "there", ray=ray_nodes.cluster.address, **options)
    assert killed
    assert killed[-1] not in ray_nodes.nodes
    assert pools[0].replaced >= 1
    train_tracker(library, tmp_path / "here", **options)
    there, here = bytes_of(tmp_path / "there"), bytes_of(tmp_path / "here")
    assert there["policy.safetensors"] == here["policy.safetensors"]
    first, second = load(there["checkpoint.safetensors"]), load(here["checkpoint.safetensors"])
    assert first.keys() == second.keys()
    for name, array in first.items():
        np.testing.assert_array_equal(array, second[name], err_msg=name)


def test_the_policy_is_a_tracker_with_its_critic(library: Path, tmp_path: Path, quick: None) -> None:
    train_tracker(library, tmp_path, config=CONFIG, workers=1, engine="pybullet")
    policy, record = Policy.load(tmp_path / "policy.safetensors")
    assert is_tracker(record)
    assert list(record["provenance"]["inputs"]) == ["library"]
    assert [weight.shape[0] for weight, _ in policy.critic] == [16, 8, 1]
    assert record["best"]["episodes"] == 2
    # Of a tracker's own interval, and the last one at the end.
    assert [one["samples"] for one in record["evaluations"]] == [2 * ROUND, 4 * ROUND]


def test_the_policy_has_the_mean_weights_of_the_last_rounds(
    library: Path, tmp_path: Path, quick: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By hand, with averages over two rounds: from random weights, and from those of a tracker."""
    monkeypatch.setattr(runner, "AVERAGED", 2 * ROUND)
    monkeypatch.setattr(runner, "EARLY", 1.0)
    weights: list[np.ndarray] = []
    update = PpoAlgorithm.update

    def noted(self: PpoAlgorithm, samples: Samples) -> dict[str, float]:
        logged = update(self, samples)
        weights.append(self.net.actor.parameters.numpy().copy())
        return logged

    monkeypatch.setattr(PpoAlgorithm, "update", noted)
    options: dict[str, Any] = {"config": CONFIG, "workers": 1, "engine": "pybullet"}
    train_tracker(library, tmp_path / "first", **options)
    average = weights[0]
    for one in weights[1:]:
        average = (average + one) / 2
    state = load((tmp_path / "first/checkpoint.safetensors").read_bytes())
    np.testing.assert_allclose(state["algorithm.average"], average, atol=1e-7)
    assert np.abs(average - weights[-1]).max() > 1e-5

    algorithm = runner.TrackerAlgorithm(CONFIG, 2)
    algorithm.restore({name[10:]: torch.from_numpy(array) for name, array in state.items()
                       if name.startswith("algorithm.")}, checkpoint_record(tmp_path / "first"))  # fmt: skip
    kept, acting = (
        np.concatenate([part.ravel() for layer in policy.layers for part in layer])
        for policy in (algorithm.policy(), algorithm.acting())
    )
    np.testing.assert_array_equal(kept, state["algorithm.average"])
    np.testing.assert_array_equal(acting, weights[-1])
    algorithm.begin_from(algorithm.policy())
    np.testing.assert_array_equal(algorithm.acting().layers[0][0], algorithm.policy().layers[0][0])


def checkpoint_record(folder: Path) -> dict[str, Any]:
    with safe_open(folder / "checkpoint.safetensors", "np") as stream:
        record: dict[str, Any] = json.loads(stream.metadata()["kinemimic"])
    return record


def test_another_library_is_refused(library: Path, tmp_path: Path, quick: None) -> None:
    train_tracker(library, tmp_path / "out", config=CONFIG, workers=1, engine="pybullet")
    manifest = json.loads((library / "library.json").read_text())
    other = tmp_path / "other"
    other.mkdir()
    (other / "library.json").write_text(json.dumps({**manifest, "note": 1}))
    (other / "library.safetensors").write_bytes((library / "library.safetensors").read_bytes())
    with pytest.raises(KinemimicError, match="checkpoint of this library and these settings, found another"):
        train_tracker(other, tmp_path / "out", config=CONFIG, workers=1, engine="pybullet")


def test_a_damaged_checkpoint_is_told_with_an_option_that_there_is(library: Path, tmp_path: Path) -> None:
    (tmp_path / "checkpoint.safetensors").write_bytes(b"nonsense")
    with pytest.raises(
        KinemimicError, match=r"expected a checkpoint, found .*; delete it or choose another --out$"
    ):
        train_tracker(library, tmp_path, config=CONFIG, workers=1, engine="pybullet")


def test_a_library_without_a_training_part_is_refused(tmp_path: Path, library: Path) -> None:
    walk = shipped_motion("walk")
    write_library(tmp_path, MotionLibrary.of([walk], [entry("walk", "a", "test", walk)]), {})
    with pytest.raises(KinemimicError, match="found only those left out for tests"):
        train_tracker(tmp_path, tmp_path / "out", config=CONFIG)


@pytest.mark.skipif(torch.cuda.is_available(), reason="there is a GPU")
def test_a_gpu_that_is_not_there_is_refused_before_anything_is_written(library: Path, tmp_path: Path) -> None:
    with pytest.raises(KinemimicError, match=r"--device cuda: expected a GPU .* found none with torch \d"):
        train_tracker(library, tmp_path / "out", config=CONFIG, device="cuda")
    assert not (tmp_path / "out").exists()


@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a GPU that PyTorch can use")
def test_the_cpu_goes_on_with_what_a_gpu_began(library: Path, tmp_path: Path, quick: None) -> None:
    half = train_tracker(library, tmp_path, config=CONFIG, budget=2 * ROUND, workers=2, device="cuda")
    assert half["device"] == torch.cuda.get_device_name()
    whole = train_tracker(library, tmp_path, config=CONFIG, workers=2)
    assert whole["samples"] == CONFIG.budget
    assert "device" not in whole


def test_motions_are_drawn_by_their_weights(library: Path, tmp_path: Path, quick: None) -> None:
    train_tracker(library, tmp_path, config=CONFIG, budget=ROUND, workers=1, engine="pybullet")
    seeds = np.random.SeedSequence(0).spawn(40)
    sampler = TrackerSampler(tmp_path / "references", CONFIG.env, seeds, "pybullet")
    sampler.set_weights(np.array([0.0, 1.0]))
    sampler.restart(np.arange(40), 0.0)
    assert sampler.env_states()["motions"].tolist() == [1] * 40
    assert sampler.take_outcomes() == []
    sampler.set_weights(np.array([0.75, 0.25]))
    sampler.restart(np.arange(40), 0.0)
    assert 20 < (sampler.env_states()["motions"] == 0).sum() < 38


def test_an_episode_has_a_pace_within_its_range(library: Path, tmp_path: Path, quick: None) -> None:
    train_tracker(library, tmp_path, config=CONFIG, budget=ROUND, workers=1, engine="pybullet")
    low, high = CONFIG.env.domain_randomization.pace
    seeds = np.random.SeedSequence(0).spawn(40)
    sampler = TrackerSampler(tmp_path / "references", CONFIG.env, seeds, "pybullet")
    sampler.restart(np.arange(40), 1.0)
    paces = sampler.env_states()["pace"]
    assert low <= paces.min() < low + 0.05 < high - 0.05 < paces.max() <= high
    sampler.restart(np.arange(40), 0.0)
    assert (sampler.env_states()["pace"] == 1.0).all()


def test_the_largest_error_of_an_episode_narrows(
    library: Path, tmp_path: Path, quick: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    given: list[float] = []
    monkeypatch.setattr(TrackerSampler, "set_body_error", lambda _, largest: given.append(largest))
    narrowing = replace(CONFIG, body_error=((0, 0.5), (2 * ROUND, 0.3)))
    record = train_tracker(library, tmp_path, config=narrowing, workers=1, engine="pybullet")
    # The first samples only make the statistics of the observations.
    assert given == pytest.approx([0.5, 0.5, 0.4, 0.3, 0.3])
    assert record["config"]["body_error"] == [[0, 0.5], [2 * ROUND, 0.3]]
    monkeypatch.undo()
    sampler = TrackerSampler(
        tmp_path / "references", CONFIG.env, np.random.SeedSequence(0).spawn(3), "pybullet"
    )
    for largest, ends in ((9.0, False), (0.0, True)):
        sampler.set_body_error(largest)
        assert sampler.batch.step(np.zeros((3, 42))).terminated.tolist() == [ends] * 3


@pytest.mark.parametrize(
    ("start", "message"),
    [
        ("tracker", r"expected a --budget above its 96,\d{3},\d{3} samples, .* found 60,000,000"),
        ("obstacle_walk", "expected a tracker without obstacles in its observation, found one with"),
    ],
)
def test_a_start_that_leaves_nothing_to_train_or_observes_more_is_refused(
    library: Path, tmp_path: Path, start: str, message: str
) -> None:
    with pytest.raises(KinemimicError, match=message):
        train_tracker(library, tmp_path / "out", start=start)
    assert not (tmp_path / "out").exists()


def test_a_tracker_goes_on_with_another_library(library: Path, tmp_path: Path, quick: None) -> None:
    first = train_tracker(
        library, tmp_path / "first", config=CONFIG, budget=ROUND, workers=1, engine="pybullet"
    )
    begun = train_tracker(
        library,
        tmp_path / "second",
        config=CONFIG,
        start=str(tmp_path / "first"),
        budget=ROUND + 1,
        workers=1,
        engine="pybullet",
    )
    assert (first["samples"], begun["samples"]) == (ROUND, 2 * ROUND)
    assert begun["config"]["start"]
    wide = replace(CONFIG, hidden=(32, 8))
    with pytest.raises(KinemimicError, match=r"with layers of \(32, 8\) and a preview"):
        train_tracker(library, tmp_path / "third", config=wide, start=str(tmp_path / "first"))
