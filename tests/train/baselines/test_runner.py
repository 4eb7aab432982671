"""Rivals train as PPO does: same seed, same policy, also if interrupted; what is stored acts as what was
trained."""

from __future__ import annotations

import json
import signal
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime
import pytest
import torch
from msgspec import structs
from peers.killing import without_clock
from peers.small_baselines import BUDGET, ROUND, small
from safetensors.numpy import load_file
from stable_baselines3 import DDPG

from kinemimic.evaluate.scoring.evaluate import evaluate
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import write_text
from kinemimic.retarget.formats.motion_json import motion_to_json
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train import command as stage
from kinemimic.train.baselines import runner as baseline
from kinemimic.train.baselines.model import actor_layers
from kinemimic.train.baselines.off_policy import OffPolicyModel, critic_errors, entropy_weight
from kinemimic.train.baselines.runner import BaselineAlgorithm, BaselineRunner
from kinemimic.train.config import baseline_config as rival_config
from kinemimic.train.config.baseline_config import A2c, Ddpg, OffPolicy
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.presets import PRESETS
from kinemimic.train.rollout import evaluation as trial
from kinemimic.train.rollout.export_onnx import write_onnx
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.runner import training_loop as rounds
from kinemimic.train.runner.checkpoint import CHECKPOINT
from kinemimic.train.task.timer import Timer

RIVALS = [name for name, config in PRESETS.items() if config.baseline]


@pytest.fixture
def fresh(tmp_path: Path, motion: Motion, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str], Path]]:
    """Makes run folders; trainings are small, with a trial every second round and a checkpoint every one."""
    monkeypatch.setattr(trial, "EVALUATION_INTERVAL", 2 * ROUND)
    monkeypatch.setattr(trial, "CYCLIC_FRAMES", 20)
    monkeypatch.setattr(rounds, "CHECKPOINT_SECONDS", 0.0)
    # A job that a shell put into the background has a SIGINT that is ignored.
    earlier = signal.signal(signal.SIGINT, signal.default_int_handler)

    def make(name: str) -> Path:
        write_text(tmp_path / name / "motion.json", motion_to_json(motion))
        return tmp_path / name

    yield make
    signal.signal(signal.SIGINT, earlier)


def train(run: Path, config: TrainConfig, budget: int = BUDGET, **options: Any) -> dict[str, Any]:
    return stage.train(run, config=config, budget=budget, workers=1, engine="pybullet", **options)


def in_round(monkeypatch: pytest.MonkeyPatch, number: int) -> None:
    """A signal in the midst of the round that has this number, from one."""
    rounds_done, learn = iter(range(1, 1000)), BaselineRunner.round

    def acting(runner: BaselineRunner) -> dict[str, float]:
        if next(rounds_done) == number:
            signal.raise_signal(signal.SIGTERM)
        return learn(runner)

    monkeypatch.setattr(BaselineRunner, "round", acting)


def same_result(run: Path, other: Path) -> None:
    assert (run / "policy.safetensors").read_bytes() == (other / "policy.safetensors").read_bytes()
    assert without_clock(run / "policy.json") == without_clock(other / "policy.json")
    ours, theirs = (load_file(folder / CHECKPOINT) for folder in (run, other))
    assert ours.keys() == theirs.keys()
    assert {name for name in ours if ours[name].tobytes() != theirs[name].tobytes()} == set()


@pytest.mark.parametrize("name", RIVALS)
def test_interrupted_and_resumed_it_comes_to_the_same_bytes(
    name: str, fresh: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    straight, cut, config = fresh("straight"), fresh("cut"), small(name)
    train(straight, config)
    torch.rand(3)  # whoever else draws from the global generators changes nothing
    for stopped in (1, 5):
        with monkeypatch.context() as patched:
            in_round(patched, 1 if stopped == 1 else 4)
            with pytest.raises(KeyboardInterrupt, match=f"saved at {stopped * ROUND} samples"):
                train(cut, config)
    train(cut, config)
    same_result(straight, cut)
    record = json.loads((cut / "policy.json").read_text())
    assert record["samples"] == BUDGET
    assert TrainConfig.from_json(record["config"]) == config
    assert set(record["seconds_by"]) == {
        "simulation", "observation and reward", "inference", "update", "evaluation", "checkpoint", "other",
    }  # fmt: skip
    if isinstance(config.baseline, OffPolicy):
        # Not in the first round, which is its warming up.
        assert record["gradient_steps_per_sample"] == pytest.approx(0.25 * 5 / 6, abs=1e-4)


@pytest.mark.parametrize("name", RIVALS)
def test_another_seed_is_another_policy_and_keeps_the_checkpoint_aside(
    name: str, fresh: Callable[[str], Path]
) -> None:
    run, config = fresh("run"), small(name)
    train(run, config, ROUND)
    policy, saved = ((run / file).read_bytes() for file in ("policy.safetensors", CHECKPOINT))
    train(run, replace(config, seed=1), ROUND)
    assert (run / "policy.safetensors").read_bytes() != policy
    assert (run / stage.PREVIOUS).read_bytes() == saved
    train(run, replace(config, baseline=None), ROUND)
    assert json.loads((run / "policy.json").read_text())["config"].get("baseline") is None


@pytest.mark.parametrize("name", RIVALS)
@pytest.mark.parametrize("activation", ["tanh", "relu"])
def test_the_stored_policy_acts_as_the_trained_one(
    name: str, activation: str, motion: Motion, tmp_path: Path
) -> None:
    config = small(name)
    assert config.baseline is not None
    config = replace(config, baseline=structs.replace(config.baseline, activation=activation))
    algorithm = BaselineAlgorithm(config, motion, "pybullet", 1)
    runner = BaselineRunner(algorithm, Timer())
    runner.start(None)
    runner.round()
    # As far as actors go that have learnt for long.
    with torch.no_grad():
        actor_layers(algorithm.model)[-1].weight.mul_(30.0)
    random = np.random.default_rng(0)
    stands = algorithm.env.sampler.batch.observe()
    seen = (
        (stands + random.normal(0, 0.3, (20, *stands.shape))).reshape(-1, stands.shape[1]).astype(np.float32)
    )
    wanted, _ = algorithm.model.predict(algorithm.normalizer.normalize_obs(seen), deterministic=True)
    assert np.abs(wanted).max() > 0.05
    algorithm.policy().save(
        tmp_path / "p.safetensors", {"config": config.to_json(), "provenance": {}, "mirrored": True}
    )
    policy, record = Policy.load(tmp_path / "p.safetensors")
    np.testing.assert_allclose(policy.act(seen), wanted, atol=1e-5)
    write_onnx(tmp_path / "p.onnx", policy, record)
    session = onnxruntime.InferenceSession(tmp_path / "p.onnx", providers=["CPUExecutionProvider"])
    np.testing.assert_allclose(session.run(["action"], {"observation": seen})[0], wanted, atol=1e-5)


def test_what_a_rival_learnt_is_evaluated_as_any_policy(
    fresh: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    run = fresh("run")
    train(run, small("ddpg"), ROUND)
    monkeypatch.setattr("kinemimic.train.rollout.evaluation.START_PHASES", 1)
    assert evaluate(run, workers=1, engine="pybullet")["survival"]["frames"] > 0


def test_without_the_package_it_is_one_line_and_nothing_is_written(
    fresh: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    run = fresh("run")
    monkeypatch.setattr(rival_config, "find_spec", lambda _: None)
    with pytest.raises(KinemimicError, match=r"found none; pip install 'kinemimic\[baselines\]'"):
        stage.train(run, preset_name="ddpg")
    assert [path.name for path in run.iterdir()] == ["motion.json"]


def test_a_spoilt_rival_stops_with_one_line(
    fresh: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    run, explore = fresh("run"), baseline.set_exploration

    def spoiling(model: DDPG, config: TrainConfig, samples: int) -> float:
        if samples == 2 * ROUND:
            model.policy.actor.mu[0].weight.data[0, 0] = np.nan
        return explore(model, config, samples)

    monkeypatch.setattr(baseline, "set_exploration", spoiling)
    with pytest.raises(KinemimicError, match=rf"at {2 * ROUND} samples: .* NaN; .*{CHECKPOINT} "):
        train(run, small("ddpg"))
    assert all(np.isfinite(array).all() for array in load_file(run / CHECKPOINT).values())


def test_noise_follows_the_schedule_of_ours(motion: Motion) -> None:
    for name in set(RIVALS) - {"sac"}:
        config = replace(small(name), action_std=((0, 0.08), (ROUND, 0.02)))
        runner = BaselineRunner(BaselineAlgorithm(config, motion, "pybullet", 1), Timer())
        runner.start(None)
        assert [runner.round()["policy/noise"] for _ in range(2)] == pytest.approx([0.08, 0.02])


@pytest.mark.parametrize("name", ["a2c", "sac"])
def test_learnt_noise_begins_where_the_schedule_does_and_moves(name: str, motion: Motion) -> None:
    config = small(name)
    config = replace(config, learn_action_std=name == "a2c")
    runner = BaselineRunner(BaselineAlgorithm(config, motion, "pybullet", 1), Timer())
    runner.start(None)
    # An algorithm with a replay buffer learns nothing in its warm-up, the first round.
    first, _, last = (runner.round()["policy/noise"] for _ in range(3))
    assert first == pytest.approx(0.08, rel=0.01)
    assert last != first


@pytest.mark.parametrize(("name", "critics"), [("ddpg", 1), ("td3", 2), ("sac", 2)])
def test_the_target_of_an_end_is_its_reward(name: str, critics: int, motion: Motion) -> None:
    """Nothing comes after an end. Without one, the discounted value is added."""
    algorithm = BaselineAlgorithm(small(name), motion, "pybullet", 1)
    runner = BaselineRunner(algorithm, Timer())
    runner.start(None)
    runner.round()
    memory, model = algorithm.memory, algorithm.model
    assert memory is not None
    assert isinstance(model, OffPolicyModel)
    memory.timeouts[:], memory.rewards[:] = 0.0, 0.25
    memory.dones[:] = 1.0
    errors, targets = critic_errors(model, 40)
    assert len(errors) == 40 * critics
    np.testing.assert_allclose(targets, 0.25, atol=1e-6)
    memory.dones[:] = 0.0
    assert np.ptp(critic_errors(model, 40)[1]) > 0.0


def test_the_weight_of_the_entropy_is_learned_and_restored(motion: Motion) -> None:
    algorithm = BaselineAlgorithm(small("sac"), motion, "pybullet", 1)
    (untrained,) = (float(one.exp()) for one in entropy_weight(algorithm.model).values())
    assert untrained == pytest.approx(0.01)
    runner = BaselineRunner(algorithm, Timer())
    runner.start(None)
    for _ in range(3):
        runner.round()
    (learned,) = (float(one.exp()) for one in entropy_weight(algorithm.model).values())
    assert learned != untrained
    again = BaselineAlgorithm(small("sac"), motion, "pybullet", 1)
    again.restore({name: one.clone() for name, one in algorithm.tensors().items()}, algorithm.record())
    assert [float(one.exp()) for one in entropy_weight(again.model).values()] == [learned]


def test_the_critic_of_a_rollout_is_measured_against_its_own_targets(motion: Motion) -> None:
    """On-policy: 1 less the explained variance, but for the mean error, which it counts too."""
    runner = BaselineRunner(BaselineAlgorithm(small("sb3-ppo"), motion, "pybullet", 1), Timer())
    runner.start(None)
    logged = runner.round()
    assert logged["value/normalized_loss"] >= 1.0 - logged["value/explained_variance"] - 1e-6
    assert logged["value/normalized_loss"] > 0.0


def test_actors_begin_near_the_reference(motion: Motion) -> None:
    for name in RIVALS:
        algorithm = BaselineAlgorithm(small(name), motion, "pybullet", 1)
        algorithm.env.sampler.begin_round(algorithm.config.env.reward)
        assert np.abs(algorithm.policy().act(algorithm.env.sampler.batch.observe())).max() < 0.1


def test_rates_of_actor_and_critic_are_their_own(motion: Motion) -> None:
    config = replace(
        small("ddpg"), baseline=structs.replace(Ddpg(), actor_rate=0.0, warm_up=0, batch=16, buffer=640)
    )
    algorithm = BaselineAlgorithm(config, motion, "pybullet", 1)
    assert isinstance(algorithm.model, DDPG)
    nets = algorithm.model.actor, algorithm.model.critic
    before = [torch.cat([p.flatten() for p in net.parameters()]).clone() for net in nets]
    runner = BaselineRunner(algorithm, Timer())
    runner.start(None)
    runner.round()
    after = [torch.cat([p.flatten() for p in net.parameters()]) for net in nets]
    assert [bool((a == b).all()) for a, b in zip(before, after, strict=True)] == [True, False]


@pytest.mark.parametrize("name", RIVALS)
def test_a_rival_does_the_task_of_default(name: str) -> None:
    config = PRESETS[name]
    assert config.preset == name
    default = PRESETS["default"]
    # How many figures it has and how it explores is its own, found by the search.
    own = {"num_envs": 64, "horizon": 64, "action_std": default.action_std}
    assert replace(config, preset="default", baseline=None, **own) == default
    assert config.batch == default.batch


def test_settings_that_do_not_fit_are_refused_by_name() -> None:
    value = PRESETS["a2c"].to_json()
    for change, told in (
        (
            {"algorithm": "trpo"},
            r"key baseline\.algorithm: expected one of ddpg, td3, sac, a2c, ppo, found 'trpo'",
        ),
        ({"tau": 0.1}, r"key baseline\.tau: expected one of actor_rate, .*found 'tau'"),
        (
            {"activation": "elu"},
            r"key baseline\.activation: expected one of relu, tanh, found 'elu'; did you mean 'relu'",
        ),
        ({"n_steps": 7}, "key horizon: expected a multiple of the baseline's 7 steps, found 256"),
    ):
        with pytest.raises(KinemimicError, match=told):
            TrainConfig.from_json({**value, "baseline": {**value["baseline"], **change}})
    del value["baseline"]["actor_rate"]
    with pytest.raises(KinemimicError, match=r"key baseline\.actor_rate: expected a value, found none"):
        TrainConfig.from_json(value)


def test_what_has_no_rival_is_stored_as_before() -> None:
    assert "baseline" not in PRESETS["default"].to_json()
    assert replace(PRESETS["default"], baseline=A2c()).to_json()["baseline"]["algorithm"] == "a2c"
