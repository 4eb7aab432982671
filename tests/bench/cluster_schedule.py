"""How long tasks and rounds would take on clusters of any size: the schedule, simulated from measured costs.

It knows what saturates first: the cores, the driver that hands out the tasks one after the other, or its
network link. It does not know failures, nodes of different speed, or switches that are shared with others.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass
from math import ceil


@dataclass(frozen=True)
class TaskCosts:
    """compute: s of a task on one core, with its child process; dispatch: s of the driver for each task;
    sent, returned: bytes; bandwidth: of the driver's link, bytes/s."""

    compute: float
    dispatch: float
    sent: float = 0.0
    returned: float = 0.0
    bandwidth: float = 1.25e9


def makespan(tasks: int, cores: int, costs: TaskCosts) -> float:
    """Seconds from the first task's dispatch until the driver has the last result.

    A task is handed out when a core is free, and its result is fetched when the link is free, in the order in
    which they finish.
    """
    free = [0.0] * cores  # when each core is
    heapq.heapify(free)
    driver = 0.0
    finished: list[float] = []
    for _ in range(tasks):
        # Hand-outs and bytes pass through the driver one by one, while earlier tasks run.
        driver += costs.dispatch + costs.sent / costs.bandwidth
        end = max(driver, heapq.heappop(free)) + costs.compute
        heapq.heappush(free, end)
        finished.append(end)
    link = 0.0
    for end in sorted(finished):
        link = max(link, end) + costs.returned / costs.bandwidth
    return link


@dataclass(frozen=True)
class RoundCosts:
    """A round of training: samples, in equal shares of whole environments; sample: s of one on one core;
    update: s of the learner; weights: bytes, once to every node; sample_bytes: of one sample's return; call:
    s of the driver for each actor; bandwidth: of the driver's link, bytes/s."""

    samples: int
    environments: int
    sample: float
    update: float
    weights: float
    sample_bytes: float
    call: float
    bandwidth: float = 1.25e9


@dataclass(frozen=True)
class Round:
    """Seconds of a round by what they are spent on; the sum is the round."""

    broadcast: float
    rollout: float
    returning: float
    update: float

    @property
    def seconds(self) -> float:
        return self.broadcast + self.rollout + self.returning + self.update


def training_round(nodes: int, cores: int, costs: RoundCosts) -> Round:
    """A round on `nodes` with `cores` each: an actor per core, at most one per environment."""
    actors = min(nodes * cores, costs.environments)
    reached = min(nodes, actors)
    largest = ceil(costs.environments / actors) / costs.environments
    return Round(
        broadcast=reached * costs.weights / costs.bandwidth + actors * costs.call,
        rollout=largest * costs.samples * costs.sample,
        returning=costs.samples * costs.sample_bytes / costs.bandwidth,
        update=costs.update,
    )
