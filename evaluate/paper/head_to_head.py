"""Head-to-head trials: several algorithms in the same scenarios with the same random draws."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from statistics import median
from typing import Any

from kinemimic.evaluate.compare.comparison import TrainedPolicy
from kinemimic.evaluate.paper.lead import lead, loss
from kinemimic.evaluate.robustness.scenario_trials import Trials, run_all_trials, summarize, trial_tasks
from kinemimic.pipeline.parallel.executor import Executor
from kinemimic.train.scenario.scenario import Scenario


def head_to_head(
    pairs: Sequence[tuple[Sequence[TrainedPolicy], Scenario]],
    *,
    trials: int,
    seed: int,
    engine: str,
    workers: int | None = None,
    executor: Executor | None = None,
    over: Mapping[str, str] | None = None,
    progress: Callable[[float], object] | None = None,
) -> list[dict[str, Any]]:
    """One row per pair of an algorithm's policies (one for each seed of its training, of the same name) and a
    scenario, in order.

    A row has the policies' name, the samples of a training, the median number after which the policy was
    saved, the metrics of all trials, the number of seeds and of those whose undisturbed control runs mostly
    fall, and `loss` and `lead` (`lead.py`). Trial k is the same for all policies: start phase and draws
    depend on seed and k alone.

    trials: of every policy; workers: processes (default: all cores); executor: what runs the tasks, in
    place of them; over: name -> name whose lead over it is computed, in scenarios with both; otherwise the
    lead is None; progress: called with the share of trials finished since the last call.
    """
    groups = [
        trial_tasks(one.motion, one.policy, one.config, scenario, trials=trials, seed=seed, engine=engine)
        for policies, scenario in pairs
        for one in policies
    ]
    count = sum(map(len, groups))
    share = progress and (lambda k: progress(k / count))
    done = iter(run_all_trials(groups, workers=workers, executor=executor, progress=share))
    found = [[next(done) for _ in policies] for policies, _ in pairs]
    names = [(policies[0].name, scenario.name) for policies, scenario in pairs]
    by = dict(zip(names, found, strict=True))
    rows = []
    for (policies, _), (name, where), theirs in zip(pairs, names, found, strict=True):
        leader = by.get((over[name], where)) if over and name in over else None
        rows.append({
            "policy": name,
            "samples": policies[0].samples,
            "kept": int(median(one.kept for one in policies)),
            "scenario": where,
            **summarize(Trials.joined(theirs)),
            "seeds": len(theirs),
            "seeds_fallen": sum(bool(one.control_fell.mean() > 0.5) for one in theirs),
            "loss": loss(theirs),
            "lead": lead(leader, theirs) if leader else None,
        })  # fmt: skip
    return rows
