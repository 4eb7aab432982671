"""Pushes against the simulated figure: where they come, how hard the next one is, and whether it survives.

A trial begins on the reference SETTLE control steps before its push, so that the figure walks as it walks by
then. For PUSH steps a constant horizontal force acts on the pelvis, at its centre of mass. The figure
survives if it has not fallen (`ImitationBatch.fallen`) until SURVIVE steps after the push; how far it has
drifted does not count.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Sequence
from dataclasses import dataclass

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.retarget.humanoid.body import BODIES, BODY_INDEX
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.config import EnvConfig
from kinemimic.train.reference.heading import heading
from kinemimic.train.reference.reference import Reference
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.rollout.rollout import roll_out
from kinemimic.train.sim.engines import open_world
from kinemimic.train.sim.world import CONTROL_RATE
from kinemimic.train.task.env import ImitationBatch

SETTLE = CONTROL_RATE  # control steps: 1 s
PUSH = CONTROL_RATE // 5  # 0.2 s
# 5 s, four cycles of a walk: of a default policy's 83 falls by 60, 80, 100 N two came later, half by 1.5 s.
SURVIVE = 5 * CONTROL_RATE
PELVIS = BODY_INDEX["pelvis"]

# Where a push leads, in radians from the reference's heading, Z up.
DIRECTIONS: dict[str, float] = {
    "forward": 0.0,
    "backward": math.pi,
    "left": 0.5 * math.pi,
    "right": -0.5 * math.pi,
}
GRID = (40.0, 60.0, 80.0, 100.0, 125.0, 150.0, 200.0, 250.0, 300.0)  # N, tried in every phase
BEYOND = (400.0, 500.0, 600.0)  # N, for who survives all of these
RESOLUTION = 2.0  # N


@dataclass(frozen=True)
class Found:
    """What a search found out about one phase and one direction.

    border: N, the largest force below the first that fells the figure, to within RESOLUTION; 0 where it falls
    without a push, the last of BEYOND where nothing tried felled it. unpushed: it survives with no push.
    grid: whether it survives each force of GRID. Survival need not be monotone: a push above the border may
    be survived, because the figure then happens to step otherwise. Such luck shows in `grid` only.
    """

    border: float
    unpushed: bool
    grid: tuple[bool, ...]


# Forces (N) to try next out, whether the figure survived them in.
Search = Generator[float, bool, Found]


def search() -> Search:
    """Find the border: no push, the grid upwards, then bisection between the last force before the first fall
    and that first fall. A bisection of the whole range could land on any border of several; this is the
    lowest that the grid can see."""
    if not (yield 0.0):
        return Found(0.0, False, (False,) * len(GRID))
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
        for force in BEYOND:
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
    return Found(low, True, tuple(survived))


def push_phases(motion: Motion, count: int) -> Array:
    """Phases (count,) at which pushes begin: all around a cycle; within a single performance so that it lasts
    from SETTLE before the push to SURVIVE after it.

    KinemimicError for a performance that is too short for that.
    """
    if motion.cyclic:
        return np.arange(count) / count
    first = SETTLE / CONTROL_RATE
    last = motion.duration - (PUSH + SURVIVE) / CONTROL_RATE
    if last < first:
        raise KinemimicError(
            f"pushes: expected a cyclic motion, or one of at least {first + motion.duration - last:.1f} s (a "
            f"push, what comes before and what comes after), found a performance of {motion.duration:.1f} s"
        )
    return np.linspace(first, last, count) / motion.duration


@dataclass(frozen=True)
class Task:
    """One phase of the motion, to be pushed from all DIRECTIONS. engine: of `train/engines.py`."""

    motion: Motion
    policy: Policy
    config: EnvConfig
    phase: float
    engine: str


def push_all_ways(task: Task) -> list[Found]:
    """What the searches of one phase find, in the order of DIRECTIONS."""
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
) -> list[Found]:
    """Run one search on each of E figures, side by side, each from one trial to the next at its own time.

    start: phase at which every trial begins; angles: (E,) radians, where in the world each figure's force
    leads. Results in the order of `searches`.
    """
    size = len(searches)
    wrenches = np.zeros((size, len(BODIES), 6))
    ways = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    forces = np.array([next(one) for one in searches])
    found: dict[int, Found] = {}

    def next_trials(*_: object) -> bool:
        fell = batch.fallen()
        ended = np.flatnonzero(fell | (batch.ages == SETTLE + PUSH + SURVIVE))
        for k in map(int, ended):
            # A humanoid whose search is over goes on, unpushed: no other depends on it.
            if k in found:
                continue
            try:
                forces[k] = searches[k].send(not fell[k])
            except StopIteration as done:
                found[k], forces[k] = done.value, 0.0
        if len(ended):
            batch.reset(ended, np.full(len(ended), start))
        pushed = (batch.ages >= SETTLE) & (batch.ages < SETTLE + PUSH)
        wrenches[:, PELVIS, :2] = np.where(pushed, forces, 0.0)[:, None] * ways
        return len(found) == size

    batch.reset(np.arange(size), np.full(size, start))
    roll_out(batch, policy.act, None, next_trials, until_all_fell=False, wrenches=wrenches)
    return [found[k] for k in range(size)]
