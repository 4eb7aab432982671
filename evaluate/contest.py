"""Several policies in the same scenarios, draw for draw, and what becomes of each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from kinemimic.evaluate.comparison import Contender
from kinemimic.evaluate.scenario_trials import conduct_all, figures, in_tasks
from kinemimic.train.scenario import Scenario


def contest(
    pairs: Sequence[tuple[Contender, Scenario]],
    *,
    trials: int,
    seed: int,
    engine: str,
    workers: int | None = None,
    progress: Callable[[float], object] | None = None,
) -> list[dict[str, Any]]:
    """Of every pair, in their order: contender, scenario, and the `figures` of its trials.

    Trial k is the same for all: start phase and draws come from seed and k alone. workers: processes, all
    cores by default; progress: called with the share of all trials that is done since.
    """
    tasks = [
        in_tasks(one.motion, one.policy, one.config, scenario, trials=trials, seed=seed, engine=engine)
        for one, scenario in pairs
    ]
    count = sum(map(len, tasks))
    done = conduct_all(tasks, workers=workers, progress=progress and (lambda k: progress(k / count)))
    return [
        {
            "contender": one.name,
            "samples": one.samples,
            "scenario": scenario.name,
            **figures(found),
        }
        for (one, scenario), found in zip(pairs, done, strict=True)
    ]
