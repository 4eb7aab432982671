"""Updates on a GPU: the CPU's but for rounding, the same twice, and checkpoints that either goes on from."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from kinemimic.train.config.presets import PRESETS
from kinemimic.train.ppo.ppo import PpoAlgorithm
from kinemimic.train.sampling.sampler import Samples
from kinemimic.train.task.env import ACTIONS
from kinemimic.train.task.observation import OBSERVATIONS

pytestmark = pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a GPU that PyTorch can use")

CONFIG = replace(PRESETS["default"], hidden=(64, 32), minibatch=128, epochs=3, adapt_rate=False)
CUDA = torch.device("cuda")


def drawn(seed: int) -> Samples:
    """Made-up samples without an end of an episode but the round's."""
    random = np.random.default_rng(seed)
    observations = random.normal(size=(33, 16, OBSERVATIONS)).astype(np.float32)
    never = np.zeros((32, 16), dtype=bool)
    return Samples(
        observations=observations[:-1],
        actions=random.normal(0.0, 0.15, (32, 16, ACTIONS)).astype(np.float32),
        terms=random.random((32, 16, 5)).astype(np.float32),
        terminated=never,
        truncated=never,
        next_observations=observations[1:],
        episode_lengths=np.array([], dtype=np.int64),
        exploded=0,
    )


def trained(algorithm: PpoAlgorithm, *seeds: int) -> PpoAlgorithm:
    for seed in seeds:
        algorithm.update(drawn(seed))
    return algorithm


def test_an_update_is_that_of_the_cpu_but_for_rounding(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("kinemimic.train.ppo.networks.choose_gradient_dtype", lambda _: torch.float32)
    first = PpoAlgorithm(CONFIG).tensors()
    cpu, gpu = (trained(PpoAlgorithm(CONFIG, device), 0).tensors() for device in (torch.device("cpu"), CUDA))
    for name in ("actor", "critic"):
        moved = (cpu[name] - first[name]).norm()
        assert moved > 0.01
        assert (gpu[name] - cpu[name]).norm() < 2e-2 * moved


def test_same_seed_same_bytes() -> None:
    found = [trained(PpoAlgorithm(CONFIG, CUDA), 0, 1, 2).tensors() for _ in range(2)]
    assert all(torch.equal(value, found[1][name]) for name, value in found[0].items())


def test_the_cpu_goes_on_from_a_checkpoint_of_the_gpu_and_the_gpu_from_its_own() -> None:
    half = trained(PpoAlgorithm(CONFIG, CUDA), 0)
    whole = trained(PpoAlgorithm(CONFIG, CUDA), 0, 1).tensors()
    for device, tolerance in ((CUDA, 0.0), (torch.device("cpu"), 2e-2)):
        other = PpoAlgorithm(CONFIG, device)
        other.restore(half.tensors(), half.record())
        found = trained(other, 1).tensors()
        for name in ("actor", "critic"):
            moved = (whole[name] - half.tensors()[name]).norm()
            assert (found[name] - whole[name]).norm() <= tolerance * moved


def test_the_policy_and_its_record() -> None:
    algorithm = trained(PpoAlgorithm(CONFIG, CUDA), 0)
    weight = algorithm.policy().layers[0][0]
    np.testing.assert_array_equal(weight, algorithm.net.actor.layers[0][0].cpu().numpy())
    assert algorithm.record_extras() == {"device": torch.cuda.get_device_name()}
