"""Head-to-head trials: several algorithms in the same scenarios with the same random draws.

Trial k is the same for all policies: start phase and draws depend on the seed and k alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from statistics import median
from typing import Any

from kinemimic.evaluate.compare.comparison import TrainedPolicy
from kinemimic.evaluate.paper.experiments.lead import lead, loss, survival_interval
from kinemimic.evaluate.robustness.scenario_trials import Trials, run_all_trials, summarize, trial_tasks
from kinemimic.pipeline.parallel.executor import Executor
from kinemimic.train.scenario.scenario import Scenario

TRIALS_PER_TASK = 30  # of each scenario: several policies are enough for many processes

# Of one algorithm in one scenario: the trials of each of its policies.
OfSeeds = Sequence[Trials]


def contest_trials(
    contests: Mapping[str, tuple[Sequence[TrainedPolicy], Sequence[Scenario]]],
    *,
    trials: int,
    seed: int,
    engine: str,
    workers: int | None = None,
    executor: Executor | None = None,
    progress: Callable[[float], object] | None = None,
) -> Iterator[tuple[str, dict[str, list[Trials]]]]:
    """For each algorithm, as its trials finish: its name and, by the scenario's name, the trials of each of
    its policies.

    contests: for each algorithm, its policies, one for each seed of its training, and the scenarios; trials:
    of every policy in each scenario; workers: processes (default: all cores); executor: what runs the tasks,
    in place of them; progress: called with the share of all trials finished since the last call.
    """
    groups, names = [], []
    for name, (policies, scenarios) in contests.items():
        for one in policies:
            names.append(name)
            groups.append(
                trial_tasks(
                    one.motion,
                    one.policy,
                    one.config,
                    scenarios,
                    trials=trials,
                    seed=seed,
                    engine=engine,
                    per_task=TRIALS_PER_TASK,
                )
            )
    count = sum(map(len, groups))
    share = progress and (lambda k: progress(k / count))
    done: dict[str, dict[int, list[Trials]]] = {name: {} for name in contests}
    for index, found in run_all_trials(groups, workers=workers, executor=executor, progress=share):
        name = names[index]
        done[name][index] = found
        policies, scenarios = contests[name]
        if len(done[name]) == len(policies):
            of_seeds = zip(*(one for _, one in sorted(done.pop(name).items())), strict=True)
            yield name, {scenario.name: list(of) for scenario, of in zip(scenarios, of_seeds, strict=True)}


def head_to_head(
    entries: Sequence[tuple[Sequence[TrainedPolicy], Mapping[str, OfSeeds]]],
    scenarios: Sequence[str],
    *,
    over: Mapping[str, str] | None = None,
) -> list[dict[str, Any]]:
    """One row per scenario and algorithm with trials there, in order.

    entries: the policies of each algorithm, of the same name, with their `contest_trials`; scenarios: names;
    over: name -> name whose lead over it is computed, in scenarios with both; otherwise the lead is None.

    A row has the policies' name, the samples of a training run, the median number after which the policy was
    saved, the metrics of all trials, the number of seeds and of those whose undisturbed control runs mostly
    fall, `loss` and `lead`, and the interval of survival over the seeds (`lead.py`).
    """
    by_name = {policies[0].name: found for policies, found in entries}
    rows = []
    for where in scenarios:
        for policies, found in entries:
            if where not in found:
                continue
            name, theirs = policies[0].name, found[where]
            leader = by_name.get(over[name], {}).get(where) if over and name in over else None
            rows.append({
                "policy": name,
                "samples": policies[0].samples,
                "kept": int(median(one.kept for one in policies)),
                "scenario": where,
                **summarize(Trials.joined(theirs)),
                "survived_ci95": survival_interval(theirs),
                "seeds": len(theirs),
                "seeds_fallen": sum(bool(one.control_fell.mean() > 0.5) for one in theirs),
                "loss": loss(theirs),
                "lead": lead(leader, theirs) if leader else None,
            })  # fmt: skip
    return rows
