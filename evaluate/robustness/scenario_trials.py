"""Trials of a scenario, each paired with a control run from the same start without perturbations.

The gap is the control's reward minus the trial's. The reward drop is the largest gap; the onset is the first
difference (first contact with an obstacle, first force; for a policy that observes obstacles, when it sees
the first one), and the humanoid has recovered when the gap no longer exceeds RECOVERED. Rewards are shares of
the largest possible, and 0 after a fall (`ImitationBatch.fallen`).
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.parallel.executor import Executor, unordered_results
from kinemimic.pipeline.parallel.task_pool import unordered_map
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.env_config import EnvConfig
from kinemimic.train.reference.reference import Reference
from kinemimic.train.rollout.evaluation import episode_frames
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.rollout.rollout import roll_out
from kinemimic.train.scenario.route import reference_for
from kinemimic.train.scenario.scenario import Scenario
from kinemimic.train.sim.engines import open_world
from kinemimic.train.sim.world import CONTROL_RATE
from kinemimic.train.task.env import ImitationBatch

TRIALS_PER_TASK = 5  # of each scenario, for one policy
RECOVERED = 0.05  # of the largest reward
DIFFERENT = 1e-6  # of the largest reward: larger than rounding errors


@dataclass(frozen=True)
class ScenarioTask:
    """Some trials of each scenario, by their numbers; config: with the reward to measure; seed: of all
    trials; engine: see `train/sim/engines.py`."""

    motion: Motion
    policy: Policy
    config: EnvConfig
    scenarios: tuple[Scenario, ...]
    numbers: tuple[int, ...]
    seed: int
    engine: str


@dataclass(frozen=True)
class Trials:
    """N trials of T control steps.

    phases: (N,) at the start; rewards, control: (N, T) of the trials and of their controls; fallen_at: (N,)
    control step of the fall, T without one; control_fell: (N,) whether the control fell.
    """

    phases: Array
    rewards: Array
    control: Array
    fallen_at: NDArray[np.int64]
    control_fell: NDArray[np.bool_]

    @classmethod
    def joined(cls, parts: Sequence[Trials]) -> Trials:
        """Concatenate trials."""
        return cls(
            *(np.concatenate(column) for column in zip(*(vars(p).values() for p in parts), strict=True))
        )

    def to_json(self) -> dict[str, list[Any]]:
        """Its JSON values, from which `from_json` makes the same trials to the last bit."""
        return {name: column.tolist() for name, column in vars(self).items()}

    @classmethod
    def from_json(cls, value: Mapping[str, list[Any]]) -> Trials:
        """The inverse of `to_json`."""
        return cls(**{name: np.array(column) for name, column in value.items()})


def trial_tasks(
    motion: Motion,
    policy: Policy,
    config: TrainConfig,
    scenarios: Sequence[Scenario],
    *,
    trials: int,
    seed: int,
    engine: str,
    per_task: int = TRIALS_PER_TASK,
) -> list[ScenarioTask]:
    """Tasks of `per_task` trials of each scenario, measured with the reward at the end of the training.

    Few tasks of many trials take less time in all; many tasks occupy more processes. Trial k of a seed
    depends on neither number.
    """
    chunks = [tuple(range(trials))[k : k + per_task] for k in range(0, trials, per_task)]
    return [
        ScenarioTask(motion, policy, config.measured_env, tuple(scenarios), chunk, seed, engine)
        for chunk in chunks
    ]


def run_trials(task: ScenarioTask) -> list[Trials]:
    """Run the trials of a task and their controls; one result per scenario.

    A control depends on the route and the start phases only, so scenarios that have these in common share it,
    as they share the reference of their route.
    """
    references: dict[Hashable, Reference] = {}
    longest = max(trial_steps(task.motion, scenario) for scenario in task.scenarios)
    controls: dict[Hashable, tuple[Array, NDArray[np.int64]]] = {}
    found = []
    for scenario in task.scenarios:
        seeds, phases = trial_starts(task.motion, scenario, task.seed, task.numbers)
        if scenario.route not in references:
            references[scenario.route] = reference_for(task.motion, scenario)
        reference, steps = references[scenario.route], trial_steps(task.motion, scenario)
        rewards, fallen_at = _rewards(task, reference, scenario, seeds, phases, steps)
        key = (scenario.route, tuple(phases))
        if key not in controls:
            controls[key] = _rewards(task, reference, None, seeds, phases, longest)
        control, control_fallen_at = controls[key]
        found.append(Trials(phases, rewards, control[:, :steps], fallen_at, control_fallen_at < steps))
    return found


def run_all_trials(
    groups: Sequence[Sequence[ScenarioTask]],
    *,
    workers: int | None = None,
    executor: Executor | None = None,
    progress: Callable[[int], object] | None = None,
) -> Iterator[tuple[int, list[Trials]]]:
    """(index, trials of each scenario) of each group of tasks, in the order in which the groups finish.

    executor: what runs the tasks; by default `workers` processes of this machine; progress: called with the
    number of tasks finished since the last call.
    """
    tasks = [(index, task) for index, group in enumerate(groups) for task in group]
    of_all = [task for _, task in tasks]
    parts: list[dict[int, list[Trials]]] = [{} for _ in groups]
    for number, found in (
        unordered_map(run_trials, of_all, workers=workers)
        if executor is None
        else unordered_results(executor, run_trials, of_all)
    ):
        index = tasks[number][0]
        parts[index][number] = found
        if progress is not None:
            progress(1)
        if len(parts[index]) == len(groups[index]):
            in_order = [trials for _, trials in sorted(parts[index].items())]
            parts[index].clear()
            yield index, [Trials.joined(of_one) for of_one in zip(*in_order, strict=True)]


def trial_start(motion: Motion, scenario: Scenario, seed: int, number: int) -> tuple[int, float]:
    """Seed and phase of trial `number`."""
    own = int(np.random.SeedSequence(seed, spawn_key=(number,)).generate_state(1, np.uint64)[0])
    # A separate stream of the trial's seed, whose main stream draws the events.
    phase = float(scenario.phase.draw(np.random.default_rng([own, 1]))[0])
    return own, phase if motion.cyclic else 0.0


def trial_starts(
    motion: Motion, scenario: Scenario, seed: int, numbers: Sequence[int]
) -> tuple[NDArray[np.uint64], Array]:
    """Seeds (N,) and phases (N,) of the trials with these numbers."""
    starts = [trial_start(motion, scenario, seed, number) for number in numbers]
    return np.array([own for own, _ in starts], dtype=np.uint64), np.array([phase for _, phase in starts])


def trial_steps(motion: Motion, scenario: Scenario) -> int:
    """Control steps of a trial; a non-cyclic motion may end before the scenario does."""
    return scenario.steps if motion.cyclic else min(scenario.steps, episode_frames(motion))


def _rewards(
    task: ScenarioTask,
    reference: Reference,
    scenario: Scenario | None,
    seeds: NDArray[np.uint64],
    phases: Array,
    steps: int,
) -> tuple[Array, NDArray[np.int64]]:
    """Rewards (N, steps), 0 after a fall, and the control step of the fall (N,)."""
    size = len(seeds)
    batch = ImitationBatch(open_world(size, task.engine), reference, replace(task.config, scenario=scenario))
    batch.reset(np.arange(size), phases, seeds=seeds)
    largest = sum(batch.reward.weights.values())
    rewards = np.zeros((size, steps))

    def record(step: int, standing: NDArray[np.bool_]) -> None:
        rewards[:, step] = standing * batch.terms().sum(axis=1) / largest

    fallen_at = roll_out(batch, task.policy.act_one_by_one, steps, record)
    batch.world.close()
    return rewards, fallen_at


@dataclass(frozen=True)
class EventTimes:
    """Times (N,) of N trials, in seconds; infinite for events that do not occur and in unaffected trials.

    affected: whether the rewards differ from a control that does not fall; onset_s: first difference;
    recovery_s, fall_s: counted from the onset.
    """

    affected: NDArray[np.bool_]
    onset_s: Array
    recovery_s: Array
    fall_s: Array


def event_times(trials: Trials) -> EventTimes:
    """Onset, recovery and fall of each trial."""
    steps = trials.rewards.shape[1]
    gaps = trials.control - trials.rewards
    differs, behind = np.abs(gaps) > DIFFERENT, gaps > RECOVERED
    affected = differs.any(axis=1) & ~trials.control_fell
    onset = differs.argmax(axis=1)
    fell = affected & (trials.fallen_at < steps)
    # One step after the last with a gap; a trial that ends with a gap has not recovered.
    back = np.where(behind.any(axis=1), steps - behind[:, ::-1].argmax(axis=1), onset)
    recovered = affected & ~fell & (back < steps)

    def after(step: NDArray[np.int64], happened: NDArray[np.bool_]) -> Array:
        return np.where(happened, (step - onset) / CONTROL_RATE, np.inf)

    return EventTimes(
        affected,
        np.where(affected, onset / CONTROL_RATE, np.inf),
        after(back, recovered),
        after(trials.fallen_at, fell),
    )


def summarize(trials: Trials) -> dict[str, Any]:
    """Survival, and quartiles of reward drop, recovery and fall.

    survived: share, with the 95 % interval of Wilson 1927; controls_fallen: controls that fell, whose trials
    count only in survived; affected: share of trials that differ from their control, over which the rest is
    computed; reward_drop: largest gap to the control, as a share of the largest reward; onset_s: first
    difference, from which recovery_s (of trials that recover) and fall_s (of trials with a fall) count;
    typical_recovery_s, typical_fall_s: medians over all affected trials, None if most never recover or fall.
    """
    count = len(trials.rewards)
    gaps, when = trials.control - trials.rewards, event_times(trials)
    survived = int((trials.fallen_at == trials.rewards.shape[1]).sum())
    interval = binomtest(survived, count).proportion_ci(method="wilson")
    affected = when.affected
    return {
        "trials": count,
        "survived": survived / count,
        "survived_ci95": [round(float(interval.low), 6), round(float(interval.high), 6)],
        "affected": float(affected.mean()),
        "reward_drop": _quartiles(gaps.max(axis=1)[affected]),
        "onset_s": _quartiles(when.onset_s[affected]),
        "recovered": int(np.isfinite(when.recovery_s).sum()),
        "recovery_s": _quartiles(when.recovery_s[np.isfinite(when.recovery_s)]),
        "typical_recovery_s": finite(median_time(when.recovery_s[affected])),
        "fall_s": _quartiles(when.fall_s[np.isfinite(when.fall_s)]),
        "typical_fall_s": finite(median_time(when.fall_s[affected])),
        "controls_fallen": int(trials.control_fell.sum()),
        "curve": _curve(trials.rewards),
        "control_curve": _curve(trials.control),
    }


def _quartiles(values: Array) -> dict[str, Any]:
    """Median and quartiles, None without values."""
    if not len(values):
        return {"median": None, "q25": None, "q75": None, "n": 0}
    low, middle, high = (round(float(v), 6) for v in np.percentile(values, [25, 50, 75]))
    return {"median": middle, "q25": low, "q75": high, "n": len(values)}


def median_time(times: Array) -> float:
    """Median of times, which are infinite for events that did not occur; infinite without times."""
    if not len(times):
        return np.inf
    # For an even number the later of the middle two: a finite and an infinite time have no mean.
    return float(np.sort(times)[len(times) // 2])


def finite(time: float) -> float | None:
    """A time for JSON, None if infinite."""
    return round(time, 6) if np.isfinite(time) else None


def _curve(rewards: Array) -> dict[str, list[float]]:
    """Mean and quartiles over the trials, (T,) each."""
    low, high = np.percentile(rewards, [25, 75], axis=0)
    rows = {"mean": rewards.mean(axis=0), "q25": low, "q75": high}
    return {name: np.round(row, 4).tolist() for name, row in rows.items()}
