"""Push trials: a search for the largest force that the simulated humanoid survives.

A trial starts on the reference SETTLE control steps before its push, so that the gait has settled. For PUSH
steps a constant horizontal force acts on the pelvis' centre of mass. The humanoid survives if it has not
fallen (`ImitationBatch.fallen`) SURVIVE steps after the push; drift does not count.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Sequence
from dataclasses import dataclass

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.retarget.humanoid.body import BODIES
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.env_config import EnvConfig
from kinemimic.train.recovery.pushes import PELVIS, PUSH, SETTLE, SURVIVE
from kinemimic.train.reference.heading import heading
from kinemimic.train.reference.reference import Reference
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.rollout.rollout import roll_out
from kinemimic.train.sim.engines import open_world
from kinemimic.train.sim.world import CONTROL_RATE
from kinemimic.train.task.env import ImitationBatch

# Direction of a push, in radians from the reference's heading, Z up.
DIRECTIONS: dict[str, float] = {
    "forward": 0.0,
    "backward": math.pi,
    "left": 0.5 * math.pi,
    "right": -0.5 * math.pi,
}
GRID = (40.0, 60.0, 80.0, 100.0, 125.0, 150.0, 200.0, 250.0, 300.0)  # N, tried at every phase
EXTENDED_GRID = (400.0, 500.0, 600.0)  # N, tried if all of GRID is survived
RESOLUTION = 2.0  # N


@dataclass(frozen=True)
class SearchResult:
    """Result for one phase and one direction.

    threshold: N, the largest force below the first that causes a fall, to within RESOLUTION; 0 for a fall
    without a push, the last of EXTENDED_GRID if no force caused a fall. survived_unpushed: upright without a
    push. grid: whether each force of GRID is survived. Survival need not be monotone: a push above the
    threshold may be survived because of a lucky step, which shows in `grid` only.
    """

    threshold: float
    survived_unpushed: bool
    grid: tuple[bool, ...]


# Yields the next force (N) to try, receives whether it was survived.
Search = Generator[float, bool, SearchResult]


def search() -> Search:
    """Find the threshold: no push, the grid upwards, then bisection between the first fall and the force
    before it. A bisection of the whole range could find any of several thresholds; this one is the lowest
    that the grid resolves."""
    if not (yield 0.0):
        return SearchResult(0.0, False, (False,) * len(GRID))
    survived = []
    for force in GRID:
        survived.append((yield force))
    low, high = 0.0, math.inf
    for force, stood in zip(GRID, survived, strict=True):
        if not stood:
            high = force
            break
        low = force
    else:
        for force in EXTENDED_GRID:
            if not (yield force):
                high = force
                break
            low = force
    while RESOLUTION < high - low < math.inf:
        middle = 0.5 * (low + high)
        if (yield middle):
            low = middle
        else:
            high = middle
    return SearchResult(low, True, tuple(survived))


def push_phases(motion: Motion, count: int) -> Array:
    """Phases (count,) at which pushes start: all around a cycle; in a non-cyclic motion from SETTLE after its
    start to PUSH and SURVIVE before its end.

    KinemimicError for a motion that is too short for that.
    """
    if motion.cyclic:
        return np.arange(count) / count
    first = SETTLE / CONTROL_RATE
    last = motion.duration - (PUSH + SURVIVE) / CONTROL_RATE
    if last < first:
        raise KinemimicError(
            f"pushes: expected a cyclic motion, or one of at least {first + motion.duration - last:.1f} s (a "
            f"push with the time before and after it), found a motion of {motion.duration:.1f} s"
        )
    return np.linspace(first, last, count) / motion.duration


@dataclass(frozen=True)
class PushTask:
    """One phase of the motion, to be pushed in all DIRECTIONS; engine: see `train/sim/engines.py`."""

    motion: Motion
    policy: Policy
    config: EnvConfig
    phase: float
    engine: str


def push_from_all_directions(task: PushTask) -> list[SearchResult]:
    """Results of one phase, in the order of DIRECTIONS."""
    reference = Reference(task.motion)
    ahead = heading(reference, task.phase)
    world = open_world(len(DIRECTIONS), task.engine)
    batch = ImitationBatch(world, reference, task.config)
    start = task.phase - SETTLE / (CONTROL_RATE * reference.duration)
    angles = np.array([ahead + turn for turn in DIRECTIONS.values()])
    found = run_searches(batch, task.policy, start, angles, [search() for _ in DIRECTIONS])
    world.close()
    return found


def run_searches(
    batch: ImitationBatch, policy: Policy, start: float, angles: Array, searches: Sequence[Search]
) -> list[SearchResult]:
    """Run E searches in parallel, each on its own humanoid; returns their results in order.

    start: phase at which every trial starts; angles: (E,) radians, direction of each force in the world.
    """
    size = len(searches)
    wrenches = np.zeros((size, len(BODIES), 6))
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    forces = np.array([next(one) for one in searches])
    found: dict[int, SearchResult] = {}

    def next_trials(*_: object) -> bool:
        fell = batch.fallen()
        ended = np.flatnonzero(fell | (batch.ages == SETTLE + PUSH + SURVIVE))
        for k in map(int, ended):
            # A humanoid whose search is over goes on unpushed; no other depends on it.
            if k in found:
                continue
            try:
                forces[k] = searches[k].send(not fell[k])
            except StopIteration as done:
                found[k], forces[k] = done.value, 0.0
        if len(ended):
            batch.reset(ended, np.full(len(ended), start))
        pushed = (batch.ages >= SETTLE) & (batch.ages < SETTLE + PUSH)
        wrenches[:, PELVIS, :2] = np.where(pushed, forces, 0.0)[:, None] * directions
        return len(found) == size

    batch.reset(np.arange(size), np.full(size, start))
    roll_out(batch, policy.act, None, next_trials, until_all_fell=False, wrenches=wrenches)
    return [found[k] for k in range(size)]
