"""Processing times for 1000, 2000 and 3000 samples, the paper's Tab. 2: PPO, DDPG and A2C, and
stable-baselines3's PPO, which separates the algorithm's cost from our implementation's.

The paper does not say what it processed. Here, for every algorithm:

- inference: the actor on n observations (`Policy.act`, numpy, as in every rollout);
- update: one gradient step of actor and critic on a batch of n samples, in the training's own code; for DDPG
  including the target networks' update and the sampling from the replay buffer;
- learning: the gradient steps that the preset takes for n new samples, computed from the time of one step on
  the preset's own batch, and so proportional to n; work done once per round is not included.

Times are processor time of processes with one thread each. Every process has the networks of one size. It
takes all algorithms and numbers of samples in turns: other load makes processor time longer, since caches and
memory are shared, but for all alike.
"""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from kinemimic.evaluate.paper.experiments.ppo_update import OneUpdate, PpoUpdate
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.parallel.task_pool import parallel_map
from kinemimic.train.config.baseline_config import A2c, OffPolicy, StablePpo, require_package
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.presets import PRESETS, preset
from kinemimic.train.task.observation import observation_size

SAMPLES = (1000, 2000, 3000)
NETS = ((512, 256), (1024, 512))  # hidden layers: the presets' and the paper's
PRESET_OF = {"ppo": "default", "ddpg": "ddpg", "a2c": "a2c", "sb3-ppo": "sb3-ppo"}
REPEATS = 10
_WARM_UPS = 2

# Tab. 2 as printed.
PAPER: dict[str, dict[str, list[float]]] = {
    "ppo": {"mean_ms": [12.5, 26.2, 40.2], "deviation_ms": [1.7, 3.5, 5.8]},
    "ddpg": {"mean_ms": [29.4, 79.5, 178.6], "deviation_ms": [2.8, 7.2, 9.4]},
}

Name = TypeVar("Name")


@dataclass(frozen=True)
class Timing:
    """Processor time of one operation in ms: mean and standard deviation."""

    mean_ms: float
    deviation_ms: float


@dataclass(frozen=True)
class TimingTask:
    """Operations timed in turns in one process: all sizes together, so that drift does not bias the growth.

    configs: by algorithm; samples: batch sizes of updates and inference, besides the presets' own.
    """

    configs: Mapping[str, TrainConfig]
    samples: Sequence[int]
    repeats: int
    seed: int


@dataclass(frozen=True)
class Measured:
    """Timings of one algorithm: inference, update (per number of samples), step (on the preset's batch)."""

    inference: list[Timing]
    update: list[Timing]
    step: Timing


def processing_times(
    *,
    samples: Sequence[int] = SAMPLES,
    nets: Sequence[tuple[int, ...]] = NETS,
    repeats: int = REPEATS,
    seed: int = 0,
    workers: int | None = None,
    progress: Callable[[float], object] | None = None,
) -> dict[str, Any]:
    """Measure all algorithms; returns JSON values.

    workers: processes, each with one thread and the networks of one size (default: all cores); progress:
    called with the share finished since the last call.

    samples (at least two), repeats, threads (1), seed: of the measurement;
    nets: per network size, `hidden` and, by algorithm (None if stable-baselines3 is not installed),
    `inference` and `update`, each with mean_ms and deviation_ms per number of samples and the `growth` of
    mean_ms; and `learning`: the preset's `batch` and `steps_per_sample`, `step` (Timing of one gradient step
    on that batch), and mean_ms per number of samples;
    paper: mean_ms, deviation_ms and growth of Tab. 2, for 1000, 2000 and 3000 samples.
    """
    names = [name for name in PRESET_OF if name == "ppo" or _baselines_installed()]
    tasks = [
        TimingTask(
            {name: preset(PRESET_OF[name], hidden=hidden, seed=seed) for name in names},
            tuple(samples),
            repeats,
            seed,
        )
        for hidden in nets
    ]
    # In worker processes, whose numpy and torch use one thread.
    found = parallel_map(
        measured, tasks, workers=workers, progress=progress and (lambda k: progress(k / len(tasks)))
    )
    return {
        "samples": list(samples),
        "repeats": repeats,
        "threads": 1,
        "seed": seed,
        "nets": [_net(task, one) for task, one in zip(tasks, found, strict=True)],
        "paper": {name: {**one, "growth": growth(SAMPLES, one["mean_ms"])} for name, one in PAPER.items()},
    }


def measured_on(workers: int | None = None) -> dict[str, Any]:
    """What the times depend on, as JSON values: settings, packages, processor and number of processes."""
    return {
        "processes": min(workers or len(os.sched_getaffinity(0)), len(NETS)),
        "samples": list(SAMPLES),
        "nets": [list(hidden) for hidden in NETS],
        "repeats": REPEATS,
        "presets": {name: PRESETS[of].to_json() for name, of in PRESET_OF.items()},
        "stable_baselines3": version("stable-baselines3") if _baselines_installed() else None,
        "processor": _processor(),
    }


def _processor() -> str:
    listed = Path("/proc/cpuinfo")
    names = [line for line in listed.read_text().splitlines() if line.startswith("model name")]
    return names[0].partition(":")[2].strip() if names else platform.machine()


def growth(samples: Sequence[int], times: Sequence[float]) -> float:
    """Exponent p of time ~ nᵖ: the least-squares slope of log time over log n."""
    return float(np.polyfit(np.log(samples), np.log(times), 1)[0])


def own_batch(config: TrainConfig) -> int:
    """Samples of a gradient step in training."""
    baseline = config.baseline
    if isinstance(baseline, OffPolicy | StablePpo):
        return baseline.batch
    return config.num_envs * baseline.n_steps if isinstance(baseline, A2c) else config.minibatch


def steps_per_sample(config: TrainConfig) -> float:
    """Gradient steps of the training per new sample."""
    baseline = config.baseline
    if isinstance(baseline, OffPolicy):
        return baseline.updates_per_sample
    epochs = baseline.epochs if isinstance(baseline, StablePpo) else 1 if baseline else config.epochs
    return epochs / own_batch(config)


def measured(task: TimingTask) -> dict[str, Measured]:
    """Timings by algorithm, measured in this process."""
    operations: dict[tuple[str, str, int], Callable[[], object]] = {}
    for name, config in task.configs.items():
        own = own_batch(config)
        operations[name, "step", own] = _update(config, own, task.seed).step
        for count in task.samples:
            update = _update(config, count, task.seed)
            operations[name, "update", count] = update.step
            operations[name, "inference", count] = _acting(update, config, count, task.seed)
    timings = timed(operations, task.repeats)
    return {
        name: Measured(
            [timings[name, "inference", count] for count in task.samples],
            [timings[name, "update", count] for count in task.samples],
            timings[name, "step", own_batch(config)],
        )
        for name, config in task.configs.items()
    }


def timed(
    operations: Mapping[Name, Callable[[], object]],
    repeats: int,
    clock: Callable[[], float] = time.process_time,
) -> dict[Name, Timing]:
    """Time operations in turns, after warm-up turns, so that other load affects all equally."""
    spent: dict[Name, list[float]] = {name: [] for name in operations}
    for turn in range(_WARM_UPS + repeats):
        for name, operation in operations.items():
            before = clock()
            operation()
            if turn >= _WARM_UPS:
                spent[name].append(1e3 * (clock() - before))
    return {
        name: Timing(float(np.mean(times)), float(np.std(times, ddof=1)) if repeats > 1 else 0.0)
        for name, times in spent.items()
    }


def _acting(update: OneUpdate, config: TrainConfig, count: int, seed: int) -> Callable[[], object]:
    policy, random = update.policy(), np.random.default_rng(seed)
    seen = random.standard_normal((count, observation_size(config.env)), dtype=np.float32)
    return lambda: policy.act(seen)


def _baselines_installed() -> bool:
    try:
        require_package()
    except KinemimicError:
        return False
    return True


def _update(config: TrainConfig, samples: int, seed: int) -> OneUpdate:
    if config.baseline is None:
        return PpoUpdate(config, samples, seed)
    from kinemimic.evaluate.paper.experiments.baseline_update import BaselineUpdate  # noqa: PLC0415 (its package may be missing)

    return BaselineUpdate(config, samples, seed)


def _net(task: TimingTask, found: Mapping[str, Measured]) -> dict[str, Any]:
    """Results of one network size."""
    algorithms: dict[str, Any] = dict.fromkeys(PRESET_OF)
    for name, config in task.configs.items():
        one, often = found[name], steps_per_sample(config)
        algorithms[name] = {
            "inference": _row(task.samples, one.inference),
            "update": _row(task.samples, one.update),
            "learning": {
                "batch": own_batch(config),
                "steps_per_sample": often,
                "step": vars(one.step),
                "mean_ms": [often * count * one.step.mean_ms for count in task.samples],
            },
        }
    return {"hidden": list(task.configs["ppo"].hidden), "algorithms": algorithms}


def _row(samples: Sequence[int], timings: Sequence[Timing]) -> dict[str, Any]:
    columns = {field.name: [getattr(one, field.name) for one in timings] for field in fields(Timing)}
    return {**columns, "growth": growth(samples, columns["mean_ms"])}
