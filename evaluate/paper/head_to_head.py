"""Several policies in the same scenarios, draw for draw, and what becomes of each."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from kinemimic.evaluate.compare.comparison import TrainedPolicy
from kinemimic.evaluate.paper.lead import lead, loss
from kinemimic.evaluate.robustness.scenario_trials import conduct_all, figures, in_tasks
from kinemimic.train.scenario.scenario import Scenario


def head_to_head(
    pairs: Sequence[tuple[TrainedPolicy, Scenario]],
    *,
    trials: int,
    seed: int,
    engine: str,
    workers: int | None = None,
    over: Mapping[str, str] | None = None,
    progress: Callable[[float], object] | None = None,
) -> list[dict[str, Any]]:
    """Of every pair, in their order: contender, scenario, samples (of the training), kept (after how many of
    them this policy was), the `figures` of its trials, and `loss` and `lead` of `contest_lead.py`.

    Trial k is the same for all: start phase and draws come from seed and k alone. workers: processes, all
    cores by default; over: by a contender's name that of the one whose lead over it is told, in scenarios in
    which both take part; the lead of others is None; progress: called with the share of all trials that is
    done since.
    """
    tasks = [
        in_tasks(one.motion, one.policy, one.config, scenario, trials=trials, seed=seed, engine=engine)
        for one, scenario in pairs
    ]
    count = sum(map(len, tasks))
    done = conduct_all(tasks, workers=workers, progress=progress and (lambda k: progress(k / count)))
    by = {(one.name, scenario.name): found for (one, scenario), found in zip(pairs, done, strict=True)}
    rows = []
    for (one, scenario), found in zip(pairs, done, strict=True):
        leader = by.get((over[one.name], scenario.name)) if over and one.name in over else None
        rows.append({
            "contender": one.name,
            "samples": one.samples,
            "kept": one.kept,
            "scenario": scenario.name,
            **figures(found),
            "loss": loss(found),
            "lead": lead(leader, found) if leader else None,
        })  # fmt: skip
    return rows
