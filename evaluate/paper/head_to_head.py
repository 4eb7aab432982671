"""Head-to-head trials: several policies in the same scenarios with the same random draws."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from kinemimic.evaluate.compare.comparison import TrainedPolicy
from kinemimic.evaluate.paper.lead import lead, loss
from kinemimic.evaluate.robustness.scenario_trials import run_all_trials, summarize, trial_tasks
from kinemimic.pipeline.parallel.executor import Executor
from kinemimic.train.scenario.scenario import Scenario


def head_to_head(
    pairs: Sequence[tuple[TrainedPolicy, Scenario]],
    *,
    trials: int,
    seed: int,
    engine: str,
    workers: int | None = None,
    executor: Executor | None = None,
    over: Mapping[str, str] | None = None,
    progress: Callable[[float], object] | None = None,
) -> list[dict[str, Any]]:
    """One row per pair, in order: policy name, scenario, samples of its training, samples after which the
    policy was saved, the metrics of its trials, and `loss` and `lead` (`lead.py`).

    Trial k is the same for all policies: start phase and draws depend on seed and k alone. workers: processes
    (default: all cores); executor: who carries out the trials, in place of them; over: policy name -> name of
    the policy whose lead over it is computed, in scenarios with both; otherwise the lead is None; progress:
    called with the share of trials finished since the last call.
    """
    tasks = [
        trial_tasks(one.motion, one.policy, one.config, scenario, trials=trials, seed=seed, engine=engine)
        for one, scenario in pairs
    ]
    count = sum(map(len, tasks))
    share = progress and (lambda k: progress(k / count))
    done = run_all_trials(tasks, workers=workers, executor=executor, progress=share)
    by = {(one.name, scenario.name): found for (one, scenario), found in zip(pairs, done, strict=True)}
    rows = []
    for (one, scenario), found in zip(pairs, done, strict=True):
        leader = by.get((over[one.name], scenario.name)) if over and one.name in over else None
        rows.append({
            "policy": one.name,
            "samples": one.samples,
            "kept": one.kept,
            "scenario": scenario.name,
            **summarize(found),
            "loss": loss(found),
            "lead": lead(leader, found) if leader else None,
        })  # fmt: skip
    return rows
