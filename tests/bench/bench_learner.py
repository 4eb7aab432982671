"""One update of the learner on one core and on all, against the plain way to write it and stable-baselines3.

The peers do the same update (samples, nets, minibatch, passes) with autograd and torch's own settings:
tests/peers/plain_ppo.py always, `stable_baselines3.PPO.train` if the extra `baselines` is installed (from a
filled buffer, so that values and advantages cost it nothing). All take turns; the median of the ratios is
the figure to quote. The fraction of the peak compares with the matrix products alone, outputs in float32
and gradients in the type that `choose_gradient_dtype` gives, at the speed of a large product in the same
run.
"""

from __future__ import annotations

import importlib.util
import os
import statistics
import sys
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import torch

sys.path.insert(0, str(Path(__file__).parents[1]))
from peers.plain_ppo import PlainPPO

from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.presets import PRESETS
from kinemimic.train.ppo.mlp import choose_gradient_dtype
from kinemimic.train.ppo.ppo import PpoAlgorithm
from kinemimic.train.sampling.sampler import Samples
from kinemimic.train.task.env import ACTIONS
from kinemimic.train.task.observation import OBSERVATIONS

ROUNDS = 3
CORES = sorted(os.sched_getaffinity(0))


def made_up(config: TrainConfig) -> Samples:
    """A round of samples that mean nothing."""
    random, shape = np.random.default_rng(0), (config.horizon, config.num_envs)
    observations = random.normal(size=(*shape, OBSERVATIONS)).astype(np.float32)
    return Samples(
        observations=observations,
        actions=random.normal(0.0, config.action_std[0][1], (*shape, ACTIONS)).astype(np.float32),
        terms=(0.2 * random.random((*shape, 5))).astype(np.float32),
        terminated=random.random(shape) < 0.01,
        truncated=np.zeros(shape, dtype=bool),
        next_observations=np.concatenate([observations[1:], observations[:1]]),
        episode_lengths=np.array([100]),
        exploded=0,
    )


def stable_baselines(config: TrainConfig, samples: Samples) -> Callable[[], None]:
    """The training step of stable-baselines3 on a buffer of the same shape."""
    import gymnasium
    from stable_baselines3 import PPO
    from stable_baselines3.common.logger import Logger
    from stable_baselines3.common.vec_env import DummyVecEnv

    class Nothing(gymnasium.Env[np.ndarray, np.ndarray]):
        observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (OBSERVATIONS,), np.float32)
        action_space = gymnasium.spaces.Box(-1.0, 1.0, (ACTIONS,), np.float32)

    model = PPO(
        "MlpPolicy",
        DummyVecEnv([Nothing] * config.num_envs),
        learning_rate=config.actor_rate,
        n_steps=config.horizon,
        batch_size=config.minibatch,
        n_epochs=config.epochs,
        clip_range=config.clip,
        max_grad_norm=1.0,
        policy_kwargs={
            "net_arch": {"pi": list(config.hidden), "vf": list(config.hidden)},
            "activation_fn": torch.nn.Tanh,
        },
        device="cpu",
    )
    model.set_logger(Logger(None, []))
    buffer = model.rollout_buffer
    buffer.observations, buffer.actions, buffer.full = samples.observations, samples.actions, True
    buffer.advantages = buffer.returns = samples.terms.sum(axis=-1)
    return model.train


def billions_a_second(dtype: torch.dtype) -> float:
    """10⁹ operations a second of a large matrix product: the best of several."""
    size = 2048
    a, b = torch.randn(2, size, size).to(dtype)
    into, best = torch.empty(size, size, dtype=dtype), float("inf")
    for _ in range(8):
        began = time.perf_counter()
        torch.mm(a, b, out=into)
        best = min(best, time.perf_counter() - began)
    return 2 * size**3 / best / 1e9


def products(config: TrainConfig) -> tuple[float, float]:
    """10⁹ operations of an update's matrix products: of outputs and of gradients."""
    sizes = [(OBSERVATIONS, *config.hidden, out) for out in (ACTIONS, 1)]
    whole = [sum(a * b for a, b in pairwise(size)) for size in sizes]
    # Nothing flows into the observations: the first layer has one product less. Beside the passes, the actor
    # is evaluated before and after, the critic before.
    outputs = config.epochs * sum(whole) + 2 * whole[0] + whole[1]
    gradients = config.epochs * sum(2 * n - size[0] * size[1] for n, size in zip(whole, sizes, strict=True))
    return 2e-9 * config.batch * outputs, 2e-9 * config.batch * gradients


def compare(config: TrainConfig) -> None:
    """Print seconds, fraction of the peak and ratios of one preset on the cores that are allowed."""
    learner, samples = PpoAlgorithm(config), made_up(config)
    plain = PlainPPO(learner)
    peers: dict[str, Callable[[], None]] = {"plain autograd": lambda: plain.update(samples)}
    if importlib.util.find_spec("stable_baselines3"):
        peers["stable-baselines3"] = stable_baselines(config, samples)
    runs: dict[str, Callable[[], object]] = {"kinemimic": lambda: learner.update(samples), **peers}
    seconds: dict[str, list[float]] = {name: [] for name in runs}
    for turn in range(ROUNDS + 1):
        for name, run in runs.items():
            if name == "kinemimic":
                choose_gradient_dtype()
            else:
                torch.set_float32_matmul_precision("highest")
            began = time.perf_counter()
            run()
            if turn > 0:  # the first of each is slower
                seconds[name].append(time.perf_counter() - began)
    gradient_type = choose_gradient_dtype()
    speeds = billions_a_second(torch.float32), billions_a_second(gradient_type)
    ideal = sum(work / speed for work, speed in zip(products(config), speeds, strict=True))
    print(
        f"  products: {speeds[0]:.0f} GFLOP/s float32, {speeds[1]:.0f} {gradient_type}; alone they take "
        f"{ideal:.3f} s, {ideal / statistics.median(seconds['kinemimic']):.0%} of the update"
    )
    for name, found in seconds.items():
        middle = statistics.median(found)
        line = (
            f"  {name:18} {middle:6.3f} s an update, {middle / config.batch * 1e6:5.0f} s a million samples"
        )
        if name in peers:
            ratios = [a / b for a, b in zip(found, seconds["kinemimic"], strict=True)]
            line += f", {statistics.median(ratios):5.2f} times ours ({min(ratios):.2f} to {max(ratios):.2f})"
        print(line)


def main() -> None:
    """Both presets, on one core and on all."""
    for count in sorted({1, len(CORES)}):
        os.sched_setaffinity(0, CORES[:count])
        torch.set_num_threads(count)
        for name, config in PRESETS.items():
            print(f"{name}, {count} core{'s' * (count > 1)}")
            compare(config)


if __name__ == "__main__":
    main()
