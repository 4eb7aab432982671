"""Humanoids that are pushed while a policy lets them walk."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.retarget.humanoid.body import BODIES, BODY_INDEX
from kinemimic.train.reference.heading import heading
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.sim.world import CONTROL_RATE
from kinemimic.train.task.env import ImitationBatch

SETTLE = CONTROL_RATE  # control steps before a push, in which the gait settles: 1 s
PUSH = CONTROL_RATE // 5  # control steps of a push: 0.2 s
# Control steps after it: 5 s, four cycles of a walk. Of 83 falls of a default policy after pushes of 60 to
# 100 N, half came within 1.5 s and two after 5 s.
SURVIVE = 5 * CONTROL_RATE
PELVIS = BODY_INDEX["pelvis"]


@dataclass(frozen=True)
class Pushes:
    """Pushes of N humanoids, horizontal forces on the pelvis' centre of mass.

    phases: (N,) of the reference when they begin; forces: (N,) N, 0 for none; angles: (N,) rad
    counterclockwise from the heading of the reference.
    """

    phases: Array
    forces: Array
    angles: Array

    def wrenches(self, ahead: float) -> Array:
        """(N, 15, 6) in the world, for a reference with this heading, rad."""
        found = np.zeros((len(self.forces), len(BODIES), 6))
        angles = ahead + self.angles
        found[:, PELVIS, 0], found[:, PELVIS, 1] = self.forces * np.cos(angles), self.forces * np.sin(angles)
        return found


class Acting(Protocol):
    """A policy, or several."""

    def act(self, observations: Array) -> NDArray[Any]:
        """Actions (N, 42) for observations (N, O)."""


def walk_to(batch: ImitationBatch, policy: Acting, phases: Array) -> None:
    """Let every humanoid walk for SETTLE control steps, up to phases (N,) of its reference."""
    started = phases - SETTLE / (CONTROL_RATE * batch.reference.duration)
    batch.reset(np.arange(len(phases)), started)
    observations = batch.observe()
    for _ in range(SETTLE):
        observations = batch.step(policy.act(observations).astype(np.float64)).observations


def pushed(
    batch: ImitationBatch, pushes: Pushes, steps: int, act: Callable[[int, Array], Array]
) -> Iterator[NDArray[np.bool_]]:
    """Push humanoids that have walked to the phases; yields after every control step the fallen so far.

    act: actions (N, 42) for the number of control steps since the push began, and observations (N, O). Ends
    early if nobody is upright.
    """
    wrenches = pushes.wrenches(heading(batch.reference, float(pushes.phases[0])))
    observations = batch.observe()
    fallen = np.zeros(len(pushes.forces), dtype=np.bool_)
    for step in range(steps):
        taken = act(step, observations)
        observations = batch.step(taken, wrenches if step < PUSH else None).observations
        fallen |= batch.fallen()
        yield fallen
        if fallen.all():
            return


def survived(batch: ImitationBatch, policy: Policy, pushes: Pushes) -> NDArray[np.bool_]:
    """(N,) whether the policy survives its push."""
    walk_to(batch, policy, pushes.phases)
    *_, fallen = pushed(batch, pushes, PUSH + SURVIVE, lambda _, seen: policy.act(seen).astype(np.float64))
    return ~fallen
