"""Samples per second of a whole training: stable-baselines3's PPO on the Gymnasium environments, and ours.

Rollouts and updates together, without evaluations. stable-baselines3 has its default networks and updates,
then ours (512 x 256 units, minibatches of 512, 8 epochs), on one environment of `gymnasium.make` and on 64 of
`gymnasium.make_vec`. All rows take turns on the motion of the shipped policy `walk`; the median of the rounds
is the figure to quote, the policies are the untrained ones. On a machine that does other work, set
OMP_NUM_THREADS=1: torch's threads wait for each other by spinning.
"""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Callable
from dataclasses import replace

import gymnasium
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.logger import Logger
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv, VecNormalize

from kinemimic.evaluate.gym import ENVIRONMENT
from kinemimic.evaluate.gym.stable_baselines import StableBaselinesVecEnv
from kinemimic.evaluate.gym.task import load_motion
from kinemimic.train.config.presets import PRESETS
from kinemimic.train.ppo.ppo import PpoAlgorithm
from kinemimic.train.ppo.runner import PpoRunner
from kinemimic.train.sampling.workers import Workers
from kinemimic.train.sim.engines import resolve
from kinemimic.train.task.timer import Timer

MOTION, ENVS, ROUNDS = "walk", 64, 3
CORES = len(os.sched_getaffinity(0))
CONFIG = PRESETS["default"]
OURS = {
    "learning_rate": CONFIG.actor_rate,
    "batch_size": CONFIG.minibatch,
    "n_epochs": CONFIG.epochs,
    "policy_kwargs": {
        "net_arch": list(CONFIG.hidden),
        "activation_fn": torch.nn.Tanh,
        "log_std_init": -2.0,
    },
}

Row = Callable[[], float]


def single() -> VecEnv:
    return DummyVecEnv([lambda: gymnasium.make(ENVIRONMENT, motion=MOTION)])


def batch() -> VecEnv:
    return StableBaselinesVecEnv(
        gymnasium.make_vec(ENVIRONMENT, num_envs=ENVS, motion=MOTION, autoreset_mode="SameStep")
    )


def stable_baselines(env: VecEnv, samples: int, **settings: object) -> Row:
    """Samples per second of one rollout of so many samples and its update."""
    normalized = VecNormalize(env, norm_reward=False)
    model = PPO("MlpPolicy", normalized, n_steps=samples // env.num_envs, device="cpu", seed=0, **settings)
    model.set_logger(Logger(None, []))

    def row() -> float:
        began = time.perf_counter()
        model.learn(samples, reset_num_timesteps=False)
        return samples / (time.perf_counter() - began)

    return row


def kinemimic(workers: Workers) -> Row:
    algorithm = PpoAlgorithm(CONFIG)
    runner = PpoRunner(algorithm, workers, Timer())
    runner.start(None)

    def row() -> float:
        began = time.perf_counter()
        runner.round()
        return CONFIG.batch / (time.perf_counter() - began)

    return row


def main() -> None:
    """Print one line for each row."""
    config = replace(CONFIG, num_envs=ENVS)
    with Workers(load_motion(MOTION), config.env, ENVS, 0, CORES, "auto") as workers:
        rows: dict[str, Row] = {
            "stable-baselines3 PPO, defaults, gymnasium.make": stable_baselines(single(), 2048),
            "stable-baselines3 PPO, defaults, make_vec": stable_baselines(batch(), config.batch),
            "stable-baselines3 PPO, our networks, make_vec": stable_baselines(batch(), config.batch, **OURS),
            "kinemimic's PPO": kinemimic(workers),
        }
        speeds: dict[str, list[float]] = {name: [] for name in rows}
        for turn in range(ROUNDS + 1):
            for name, row in rows.items():
                speed = row()
                if turn > 0:  # the first warms up
                    speeds[name].append(speed)
    print(f"samples a second on {CORES} cores, {resolve('auto')} engine: median (range) of {ROUNDS} rounds")
    for name, found in speeds.items():
        print(f"  {name:48} {statistics.median(found):6.0f} ({min(found):.0f} to {max(found):.0f})")


if __name__ == "__main__":
    main()
