"""Trials of a scenario: each figure beside its twin, to which nothing happens.

Both start alike. What the trial costs the figure is how far its reward stays behind the twin's: the largest
gap is the dip; it begins with the first difference (the first touch of an obstacle, the first newton), and
the figure has recovered when the gap no longer exceeds RECOVERED. After a fall (`ImitationBatch.fallen`) the
reward is 0. Rewards are shares of the largest possible.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import chain, islice
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.parallel.task_pool import parallel_map
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.config import EnvConfig, TrainConfig
from kinemimic.train.rollout.evaluation import episode_frames
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.rollout.rollout import roll_out
from kinemimic.train.scenario.route import reference_for
from kinemimic.train.scenario.scenario import Scenario
from kinemimic.train.sim.engines import open_world
from kinemimic.train.sim.world import CONTROL_RATE
from kinemimic.train.task.env import ImitationBatch

TOGETHER = 10  # trials of a task
RECOVERED = 0.05  # of the largest reward
DIFFERENT = 1e-6  # of the largest reward: what is no rounding


@dataclass(frozen=True)
class Task:
    """Trials with these numbers of one scenario; config: with the reward that is measured; seed: of all
    trials; engine: of `train/engines.py`."""

    motion: Motion
    policy: Policy
    config: EnvConfig
    scenario: Scenario
    numbers: tuple[int, ...]
    seed: int
    engine: str


@dataclass(frozen=True)
class Trials:
    """Of N trials over T control steps.

    phases: (N,) at the start; rewards, calm: (N, T) of the figure and of its twin; fallen_at: (N,) the
    control step, T for none; twin_fell: (N,) whether the twin did.
    """

    phases: Array
    rewards: Array
    calm: Array
    fallen_at: NDArray[np.int64]
    twin_fell: NDArray[np.bool_]

    @classmethod
    def joined(cls, parts: Sequence[Trials]) -> Trials:
        """All trials of the parts."""
        return cls(
            *(np.concatenate(column) for column in zip(*(vars(p).values() for p in parts), strict=True))
        )


def in_tasks(
    motion: Motion,
    policy: Policy,
    config: TrainConfig,
    scenario: Scenario,
    *,
    trials: int,
    seed: int,
    engine: str,
) -> list[Task]:
    """So many trials of a scenario, TOGETHER at a time, measured by the reward that the training ended with.

    Which tasks there are does not depend on who does them. Trial k of a seed is the same however many there
    are.
    """
    measured = replace(config.env, reward=config.final_reward)
    chunks = [tuple(range(trials))[k : k + TOGETHER] for k in range(0, trials, TOGETHER)]
    return [Task(motion, policy, measured, scenario, chunk, seed, engine) for chunk in chunks]


def conduct(task: Task) -> Trials:
    """Perform the trials of a task."""
    reference, size = reference_for(task.motion, task.scenario), len(task.numbers)
    starts = [start(task.motion, task.scenario, task.seed, number) for number in task.numbers]
    seeds = np.array([seed for seed, _ in starts], dtype=np.uint64)
    phases = np.array([phase for _, phase in starts])
    steps = steps_of(task.motion, task.scenario)
    found = []
    for scenario in (task.scenario, None):
        config = replace(task.config, scenario=scenario)
        batch = ImitationBatch(open_world(size, task.engine), reference, config)
        batch.reset(np.arange(size), phases, seeds=seeds)
        found.append(_rewards(batch, task.policy, steps))
        batch.world.close()
    (rewards, fallen_at), (calm, twin_fallen_at) = found
    return Trials(phases, rewards, calm, fallen_at, twin_fallen_at < steps)


def conduct_all(
    groups: Sequence[Sequence[Task]],
    *,
    workers: int | None = None,
    progress: Callable[[int], object] | None = None,
) -> list[Trials]:
    """The trials of each group of tasks, all spread over processes; progress: called with tasks done."""
    parts = iter(parallel_map(conduct, list(chain(*groups)), workers=workers, progress=progress))
    return [Trials.joined(list(islice(parts, len(group)))) for group in groups]


def start(motion: Motion, scenario: Scenario, seed: int, number: int) -> tuple[int, float]:
    """Seed and phase of one trial among those of a seed; they do not depend on how many there are."""
    own = int(np.random.SeedSequence(seed, spawn_key=(number,)).generate_state(1, np.uint64)[0])
    # From the same seed as the rest, but not by the same draws.
    phase = float(scenario.phase.draw(np.random.default_rng([own, 1]))[0])
    return own, phase if motion.cyclic else 0.0


def steps_of(motion: Motion, scenario: Scenario) -> int:
    """Control steps of a trial: what is performed once ends before the scenario's time."""
    return scenario.steps if motion.cyclic else min(scenario.steps, episode_frames(motion))


def _rewards(batch: ImitationBatch, policy: Policy, steps: int) -> tuple[Array, NDArray[np.int64]]:
    """Rewards (N, steps), 0 after a fall, and the control step of the fall (N,)."""
    largest = sum(batch.reward.weights.values())
    rewards = np.zeros((batch.world.size, steps))

    def act_one_by_one(observations: Array) -> Array:
        # A matrix product's last digits depend on the number of its rows, and after some contacts so would
        # the rollouts.
        return np.concatenate([policy.act(row[None]) for row in observations])

    def record(step: int, standing: NDArray[np.bool_]) -> None:
        rewards[:, step] = standing * batch.terms().sum(axis=1) / largest

    fallen_at = roll_out(batch, act_one_by_one, steps, record)
    return rewards, fallen_at


@dataclass(frozen=True)
class Moments:
    """Of N trials, (N,) each. touched: whether anything made a difference to the figure, and its twin stands;
    onset_s: of the first difference; recovery_s, fall_s: how much later. Seconds, infinite where it never is,
    and in trials that are not touched."""

    touched: NDArray[np.bool_]
    onset_s: Array
    recovery_s: Array
    fall_s: Array


def moments(trials: Trials) -> Moments:
    """When what befalls the figures begins, when it is over, and when they fall."""
    steps = trials.rewards.shape[1]
    gaps = trials.calm - trials.rewards
    differs, behind = np.abs(gaps) > DIFFERENT, gaps > RECOVERED
    touched = differs.any(axis=1) & ~trials.twin_fell
    onset = differs.argmax(axis=1)
    fell = touched & (trials.fallen_at < steps)
    # One step after the last at which it stays behind; what ends behind has not recovered.
    back = np.where(behind.any(axis=1), steps - behind[:, ::-1].argmax(axis=1), onset)
    recovered = touched & ~fell & (back < steps)

    def after(step: NDArray[np.int64], happened: NDArray[np.bool_]) -> Array:
        return np.where(happened, (step - onset) / CONTROL_RATE, np.inf)

    return Moments(
        touched,
        np.where(touched, onset / CONTROL_RATE, np.inf),
        after(back, recovered),
        after(trials.fallen_at, fell),
    )


def figures(trials: Trials) -> dict[str, Any]:
    """What the trials come to: how many survive, and of dip, recovery and fall the quartiles.

    survived: share, with the 95 % interval of Wilson 1927; twins_fallen: how many twins did, whose trials
    tell nothing of what befell them and are left out of all that follows; touched: share of the trials in
    which anything made a difference, of which alone the rest is told; dip: largest gap to the twin, as a
    share of the largest reward; onset_s: of the first difference, from which recovery_s (of those that
    recover) and fall_s (of those that fall) count; typical_recovery_s, typical_fall_s: medians of all of
    them, None where most never do.
    """
    count = len(trials.rewards)
    gaps, when = trials.calm - trials.rewards, moments(trials)
    survived = int((trials.fallen_at == trials.rewards.shape[1]).sum())
    interval = binomtest(survived, count).proportion_ci(method="wilson")
    touched = when.touched
    return {
        "trials": count,
        "survived": survived / count,
        "survived_95": [round(float(interval.low), 6), round(float(interval.high), 6)],
        "touched": float(touched.mean()),
        "dip": _quartiles(gaps.max(axis=1)[touched]),
        "onset_s": _quartiles(when.onset_s[touched]),
        "recovered": int(np.isfinite(when.recovery_s).sum()),
        "recovery_s": _quartiles(when.recovery_s[np.isfinite(when.recovery_s)]),
        "typical_recovery_s": finite(median_time(when.recovery_s[touched])),
        "fall_s": _quartiles(when.fall_s[np.isfinite(when.fall_s)]),
        "typical_fall_s": finite(median_time(when.fall_s[touched])),
        "twins_fallen": int(trials.twin_fell.sum()),
        "curve": _curve(trials.rewards),
        "calm_curve": _curve(trials.calm),
    }


def _quartiles(values: Array) -> dict[str, Any]:
    """Median and quartiles, None of nothing."""
    if not len(values):
        return {"median": None, "quarter": None, "three_quarters": None, "n": 0}
    low, middle, high = (round(float(v), 6) for v in np.percentile(values, [25, 50, 75]))
    return {"median": middle, "quarter": low, "three_quarters": high, "n": len(values)}


def median_time(times: Array) -> float:
    """Median of times, infinite where it never happened; infinite if most never do, or of none."""
    if not len(times):
        return np.inf
    # Of an even number the later of both: between a time and never there is no mean.
    return float(np.sort(times)[len(times) // 2])


def finite(time: float) -> float | None:
    """A time for JSON, None for never."""
    return round(time, 6) if np.isfinite(time) else None


def _curve(rewards: Array) -> dict[str, list[float]]:
    """Over time, (T,) each: mean and quartiles of the trials."""
    low, high = np.percentile(rewards, [25, 75], axis=0)
    rows = {"mean": rewards.mean(axis=0), "quarter": low, "three_quarters": high}
    return {name: np.round(row, 4).tolist() for name, row in rows.items()}
