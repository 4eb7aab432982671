"""Our gradient steps against stable-baselines3's own, and those of a GPU against those of a CPU."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import torch
from peers.small_baselines import ROUND, small
from stable_baselines3 import SAC, TD3

from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.baselines.off_policy import optimizers
from kinemimic.train.baselines.runner import BaselineAlgorithm, BaselineRunner
from kinemimic.train.task.timer import Timer

STEPS, BATCH = 5, 32


def warmed_up(name: str, motion: Motion) -> BaselineAlgorithm:
    """An algorithm with a round of samples, and with some updates behind it."""
    algorithm = BaselineAlgorithm(small(name), motion, "pybullet", 1)
    runner = BaselineRunner(algorithm, Timer())
    runner.start(None)
    for _ in range(2):
        runner.round()
    assert algorithm.progress.samples == 2 * ROUND
    return algorithm


@pytest.mark.parametrize("name", ["sac", "td3", "ddpg"])
def test_they_come_to_the_weights_of_stable_baselines3(name: str, motion: Motion) -> None:
    theirs, ours = (warmed_up(name, motion).model for _ in range(2))
    assert isinstance(ours, SAC | TD3)
    assert isinstance(theirs, SAC | TD3)
    for optimizer in optimizers(theirs).values():
        for group in optimizer.param_groups:
            group.update(fused=False)
    before = {key: value.clone() for key, value in ours.policy.state_dict().items()}
    for call in range(2):
        np.random.seed(call)  # noqa: NPY002 (stable-baselines3 draws from it)
        torch.manual_seed(call)
        SAC.train(theirs, STEPS, BATCH) if isinstance(theirs, SAC) else TD3.train(theirs, STEPS, BATCH)
        np.random.seed(call)  # noqa: NPY002
        torch.manual_seed(call)
        ours.train(STEPS, BATCH)
        assert ours._n_updates == theirs._n_updates
    for key, wanted in theirs.policy.state_dict().items():
        found = ours.policy.state_dict()[key]
        torch.testing.assert_close(found, wanted, rtol=1e-4, atol=2e-6)
        assert not torch.equal(found, before[key]), key
    if isinstance(ours, SAC):
        assert isinstance(theirs, SAC)
        assert ours.log_ent_coef is not None
        torch.testing.assert_close(ours.log_ent_coef, theirs.log_ent_coef)


GPU = pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a GPU that PyTorch can use")


def on_gpu(name: str, motion: Motion, source: BaselineAlgorithm) -> BaselineAlgorithm:
    """An algorithm on the GPU that goes on from another one."""
    moved = BaselineAlgorithm(small(name), motion, "pybullet", 1, torch.device("cuda"))
    moved.restore({key: value.clone() for key, value in source.tensors().items()}, source.record())
    return moved


def train_some(model: Any, call: int) -> None:
    """Three steps, so that TD3's delayed ones come at other places in every second call."""
    np.random.seed(call)  # noqa: NPY002 (stable-baselines3 draws from it)
    torch.manual_seed(call)
    model.train(3, BATCH)


@GPU
@pytest.mark.parametrize("name", ["sac", "td3", "ddpg"])
def test_on_a_gpu_they_come_to_almost_the_same_weights(name: str, motion: Motion) -> None:
    cpu = warmed_up(name, motion)
    gpu = on_gpu(name, motion, cpu)
    for call in range(5):  # without a graph, with new ones, and with those again
        train_some(cpu.model, call)
        train_some(gpu.model, call)
    for key, wanted in cpu.model.policy.state_dict().items():
        found = gpu.model.policy.state_dict()[key].cpu()
        torch.testing.assert_close(found, wanted, rtol=1e-3, atol=2e-5)


@GPU
@pytest.mark.parametrize("name", ["sac", "td3", "ddpg"])
def test_on_a_gpu_what_goes_on_from_a_checkpoint_is_the_same(name: str, motion: Motion) -> None:
    straight = on_gpu(name, motion, warmed_up(name, motion))
    for call in range(3):
        train_some(straight.model, call)
    resumed = on_gpu(name, motion, straight)
    for call in range(3, 6):
        train_some(straight.model, call)
        train_some(resumed.model, call)
    for key, wanted in straight.model.policy.state_dict().items():
        assert torch.equal(resumed.model.policy.state_dict()[key], wanted), key
