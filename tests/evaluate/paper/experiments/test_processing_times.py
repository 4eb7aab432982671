"""Processing times: the exponent by hand, a clock that is made up, and updates that move all networks."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
import torch

from kinemimic.evaluate.paper.experiments import processing_times as module
from kinemimic.evaluate.paper.experiments.baseline_update import BaselineUpdate
from kinemimic.evaluate.paper.experiments.ppo_update import OneUpdate, PpoUpdate
from kinemimic.evaluate.paper.experiments.processing_times import (
    PRESET_OF,
    Timing,
    TimingTask,
    growth,
    own_batch,
    processing_times,
    steps_per_sample,
    timed,
)
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.presets import PRESETS
from kinemimic.train.ppo.ppo import PpoAlgorithm

SMALL = (12, 8)


def made(name: str, samples: int = 40, seed: int = 0) -> OneUpdate:
    config = replace(PRESETS[PRESET_OF[name]], hidden=SMALL)
    if config.baseline is None:
        return PpoUpdate(config, samples, seed)
    return BaselineUpdate(config, samples, seed)


def networks(update: Any) -> dict[str, torch.Tensor]:
    """All weights of each network that learns or follows."""
    if isinstance(update, PpoUpdate):
        net = update.algorithm.net
        return {"actor": net.actor.parameters.clone(), "critic": net.critic.parameters.clone()}
    policy = update.model.policy
    names = {
        "actor": ("actor.", "mlp_extractor.policy_net.", "action_net."),
        "critic": ("critic.", "mlp_extractor.value_net.", "value_net."),
        "actor's target": ("actor_target.",),
        "critic's target": ("critic_target.",),
    }
    found = {
        net: [value.flatten() for name, value in policy.state_dict().items() if name.startswith(prefixes)]
        for net, prefixes in names.items()
    }
    return {net: torch.cat(parts) for net, parts in found.items() if parts}


def test_growth_by_hand() -> None:
    """3 n², 0.5 n; and of 1, 2, 8 at 1, 2, 4, whose logarithms to base 2 are 0, 1, 3 over 0, 1, 2: the slope
    is ((-1)(-4/3) + (1)(5/3)) / 2 = 1.5."""
    assert growth([1000, 2000, 3000], [3e6, 12e6, 27e6]) == pytest.approx(2.0)
    assert growth([10, 70], [5.0, 35.0]) == pytest.approx(1.0)
    assert growth([1, 2, 4], [1.0, 2.0, 8.0]) == pytest.approx(1.5)
    assert growth([1, 2, 4], [7.0, 7.0, 7.0]) == pytest.approx(0.0)


def test_operations_are_timed_by_turns_after_a_warm_up() -> None:
    """By a clock that operations set forward: the first by 1, 2, 3 … s of work, the second by 10 s."""
    now, turns = [0.0], []

    def work(name: str, seconds: Callable[[], float]) -> None:
        turns.append(name)
        now[0] += seconds()

    found = timed(
        {
            "one": partial(work, "first", lambda: float(turns.count("first"))),
            "other": partial(work, "second", lambda: 10.0),
        },
        3,
        lambda: now[0],
    )
    assert turns == ["first", "second"] * 5
    # The third, fourth and fifth.
    assert found["one"] == Timing(4000.0, 1000.0)
    assert found["other"] == Timing(10000.0, 0.0)


@pytest.mark.parametrize("name", PRESET_OF)
def test_a_step_moves_every_network_and_stays_finite(name: str) -> None:
    update = made(name)
    before, acted = networks(update), update.policy().act(np.ones((1, len(update.policy().mean)), np.float32))
    assert list(before)[:2] == ["actor", "critic"]
    assert len(before) == (4 if name == "ddpg" else 2)
    for _ in range(3):
        update.step()
    after = networks(update)
    for net, weights in before.items():
        assert torch.isfinite(after[net]).all()
        assert float((after[net] - weights).abs().max()) > 0.0, net
    assert (update.policy().act(np.ones((1, len(update.policy().mean)), np.float32)) != acted).any()


@pytest.mark.parametrize("name", PRESET_OF)
def test_same_seed_same_samples_and_weights(name: str) -> None:
    first, second, other = (made(name, seed=seed) for seed in (1, 1, 2))
    for update in (first, second, other):
        np.random.seed(0)  # noqa: NPY002 (stable-baselines3 draws its batches from it)
        torch.manual_seed(0)
        update.step()
    one, same, else_ = (torch.cat(list(networks(update).values())) for update in (first, second, other))
    assert torch.equal(one, same)
    assert not torch.equal(one, else_)


def test_ppos_step_is_one_of_its_training(monkeypatch: pytest.MonkeyPatch) -> None:
    """On all samples at once, as a round of one pass with one minibatch is."""
    seen: list[int] = []
    for step in ("actor_step", "critic_step"):
        theirs = getattr(PpoAlgorithm, step)
        monkeypatch.setattr(
            PpoAlgorithm,
            step,
            lambda self, rows, *rest, f=theirs: (seen.append(len(rows)), f(self, rows, *rest))[1],
        )
    made("ppo", 40).step()
    assert seen == [40, 40]


def test_what_training_does_with_a_sample() -> None:
    """Eight passes of minibatches of 512; an eighth of a step of 256; one step of 16 figures x 4 steps."""
    told = {name: PRESETS[preset] for name, preset in PRESET_OF.items()}
    batches = {name: own_batch(config) for name, config in told.items()}
    assert batches == {"ppo": 512, "ddpg": 256, "a2c": 64, "sb3-ppo": 512}
    assert steps_per_sample(told["ppo"]) == steps_per_sample(told["sb3-ppo"]) == 8 / 512
    assert steps_per_sample(told["ddpg"]) == 0.125
    assert steps_per_sample(told["a2c"]) == 1 / 64


def check(algorithm: dict[str, Any], config: TrainConfig) -> None:
    for kind in ("inference", "update"):
        row = algorithm[kind]
        assert all(len(row[key]) == 2 and min(row[key]) >= 0.0 for key in ("mean_ms", "deviation_ms"))
        assert row["growth"] == growth([20, 40], row["mean_ms"])
    learning = algorithm["learning"]
    one = learning["step"]["mean_ms"] * steps_per_sample(config)
    assert learning["mean_ms"] == pytest.approx([20 * one, 40 * one])


def test_the_table_has_every_algorithm_and_size() -> None:
    parts: list[float] = []
    found = processing_times(samples=(20, 40), nets=(SMALL, (6,)), repeats=2, progress=parts.append)
    assert parts == pytest.approx([0.5, 0.5])
    assert json.loads(json.dumps(found)) == found
    assert [net["hidden"] for net in found["nets"]] == [[12, 8], [6]]
    for net in found["nets"]:
        assert list(net["algorithms"]) == ["ppo", "ddpg", "a2c", "sb3-ppo"]
        for name, algorithm in net["algorithms"].items():
            check(algorithm, PRESETS[PRESET_OF[name]])
    # As printed, by hand: 40.2 ms is 3.2 times 12.5 ms, where 3 times would be linear.
    assert found["paper"]["ppo"]["growth"] == pytest.approx(1.064, abs=1e-3)
    assert found["paper"]["ddpg"]["growth"] == pytest.approx(1.620, abs=1e-3)


def test_without_the_baselines_extra_there_is_only_ppo(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing() -> None:
        raise KinemimicError("found none")

    def here(work: Callable[[TimingTask], Any], tasks: Sequence[TimingTask], **_: object) -> list[Any]:
        return [work(task) for task in tasks]

    monkeypatch.setattr(module, "require_package", missing)
    monkeypatch.setattr(module, "parallel_map", here)
    algorithms = processing_times(samples=(20, 40), nets=(SMALL,), repeats=1)["nets"][0]["algorithms"]
    assert algorithms["ddpg"] is None
    assert algorithms["a2c"] is algorithms["sb3-ppo"] is None
    check(algorithms["ppo"], PRESETS["default"])
