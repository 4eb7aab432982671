"""Samples per second of a training whose rollouts are Ray actors, against processes of this machine.

Rollouts and updates together, without evaluations, on the motion of the shipped policy `walk`, for 1, 2 and 4
samplers. Ray starts on this machine, with as many cores as samplers, so the figures are of its own cost: the
weights through the object store, the samples back, and the states that replace a lost actor. Both kinds take
turns, round by round; the median of the rounds is the figure to quote. The number of rounds may be given:
bench_ray.py [ROUNDS].
"""

from __future__ import annotations

import os
import statistics
import sys
import time
from contextlib import ExitStack

import numpy as np
import torch

from kinemimic.evaluate.gym.task import load_motion
from kinemimic.pipeline.parallel.cluster import LOCAL
from kinemimic.train.config.presets import PRESETS
from kinemimic.train.ppo.ppo import PpoAlgorithm
from kinemimic.train.ppo.runner import PpoRunner
from kinemimic.train.sampling.pool import OpenPool
from kinemimic.train.sampling.simulators import simulators
from kinemimic.train.sampling.workers import Workers
from kinemimic.train.task.timer import Timer

CONFIG = PRESETS["default"]
MOTION, COUNTS = "walk", (1, 2, 4)


class Training:
    """One training: its rounds, and the weights that it has reached."""

    def __init__(self, stack: ExitStack, count: int, open_pool: OpenPool) -> None:
        motion, config = load_motion(MOTION), CONFIG
        workers = stack.enter_context(
            Workers(motion, config.env, config.num_envs, config.seed, count, "auto", open_pool)
        )
        self._algorithm = PpoAlgorithm(config)
        self._runner = PpoRunner(self._algorithm, workers, Timer())
        self._runner.start(None)

    def speed(self) -> float:
        """Samples per second of one round."""
        began = time.perf_counter()
        self._runner.round()
        return CONFIG.batch / (time.perf_counter() - began)

    def weights(self) -> dict[str, np.ndarray]:
        """All arrays of the algorithm."""
        return {name: tensor.numpy().copy() for name, tensor in self._algorithm.tensors().items()}


def compared(count: int, rounds: int) -> str:
    """A line on `count` samplers of both kinds."""
    torch.set_num_threads(min(count, len(os.sched_getaffinity(0))))
    with ExitStack() as stack:
        here = stack.enter_context(simulators(None))
        there = stack.enter_context(simulators(LOCAL, count))
        both = [Training(stack, count, where.open_pool) for where in (here, there)]
        speeds = np.array([[training.speed() for training in both] for _ in range(rounds + 1)])[1:]
        one, other = (training.weights() for training in both)
        same = all(np.array_equal(one[name], other[name]) for name in one)
    local, actors = (statistics.median(column) for column in speeds.T)
    ratio = statistics.median(speeds[:, 1] / speeds[:, 0])
    return (
        f"  {count} samplers: processes {local:6.0f}, actors {actors:6.0f} samples/s, ratio {ratio:.3f}, "
        f"weights {'equal' if same else 'DIFFERENT'}"
    )


def main() -> None:
    """Print one line for each number of samplers."""
    rounds = int(sys.argv[1]) if sys.argv[1:] else 8
    print(f"{len(os.sched_getaffinity(0))} cores, median of {rounds} rounds of {CONFIG.batch} samples")
    for count in COUNTS:
        print(compared(count, rounds), flush=True)


if __name__ == "__main__":
    main()
