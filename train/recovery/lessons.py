"""Lessons by which a policy learns maneuvers: observations, and its actions with the maneuvers.

The pupil acts, and the teacher says what it would have done there, so that the pupil learns from the states
into which its own mistakes lead (DAgger; S. Ross et al., "A reduction of imitation learning and structured
prediction to no-regret online learning", AISTATS 2011).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array, Floats
from kinemimic.train.config.recovery import Recovery
from kinemimic.train.recovery import maneuver
from kinemimic.train.recovery.pushes import Acting, Pushes, pushed, walk_to
from kinemimic.train.recovery.search import SPREAD, Found
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.sim.world import CONTROL_RATE
from kinemimic.train.task.env import ACTIONS, ImitationBatch

# In units of the action, of every second lesson: a pupil must also learn to act off its usual path.
NOISE = 0.03
_KEEPS = 0.85  # share of the noise that a control step keeps from the one before
STEPS = 13 * CONTROL_RATE // 3  # of a lesson, from the push on
BEFORE = 8  # control steps before the push that the lesson includes
_TAUGHT = 2.0 / 3.0  # share of the humanoids that are pushed as in a search
UNPUSHED = 0.25  # share of the others
_WEAKEST = 120.0  # N
_HARDER = 1.2  # hardest push, as a factor on the hardest of the search: many maneuvers survive more
# A weak push needs no maneuver: they are taken in full from _WHOLE, not at all below _NONE, N.
_NONE, _WHOLE = 100.0, 200.0
HARDEST = 650.0  # N, hardest push from other directions, after which the pupil has to act as before
_APART = 0.25 * np.pi  # of the other directions from those that were searched


@dataclass(frozen=True)
class Teacher:
    """A policy with maneuvers for pushes around `found`; around: half of the phase between two of them."""

    policy: Policy
    found: Sequence[Found]
    around: float


def lesson(
    batch: ImitationBatch,
    teacher: Teacher,
    pupil: Policy | None,
    settings: Recovery,
    noise: float,
    random: np.random.Generator,
) -> tuple[Floats, Floats]:
    """Observations (R, O) of the humanoids that are upright, and the teacher's actions (R, 42) there.

    pupil: acts; None for the teacher itself. noise: standard deviation, in units of the action.
    """
    count = batch.world.size
    pushes, knots = _drawn(teacher, settings, count, random)
    added = maneuver.actions(knots)
    rows = Rows(pupil, noise, count, random)

    def wanted(step: int, seen: Array) -> Array:
        actions = teacher.policy.act(seen).astype(np.float64)
        if 0 <= step < len(added):
            actions = actions + batch.reflected(added[step])
        return actions

    return pushed_rows(batch, teacher.policy, pushes, rows, wanted)


def pushed_rows(
    batch: ImitationBatch, policy: Acting, pushes: Pushes, rows: Rows, wanted: Callable[[int, Array], Array]
) -> tuple[Floats, Floats]:
    """Rows of a lesson of humanoids that walk, are pushed and go on; see `lesson`.

    policy: lets them walk until the lesson begins; wanted: the teacher's actions (N, 42) for the number of
    control steps since the push began, and observations (N, O).
    """
    fallen = np.zeros(batch.world.size, dtype=np.bool_)

    def act(step: int, seen: Array) -> Array:
        return rows.act(seen, wanted(step, seen), fallen)

    walk_to(batch, policy, pushes.phases - BEFORE / (CONTROL_RATE * batch.reference.duration))
    for step in range(-BEFORE, 0):
        batch.step(act(step, batch.observe()))
    for fallen in pushed(batch, pushes, STEPS, act):  # noqa: B007 (`act` reads it)
        pass
    return rows.joined()


class Rows:
    """Collects observations and the teacher's actions there, while a pupil acts with smooth noise.

    pupil: None for the teacher itself; noise: standard deviation, in units of the action.
    """

    def __init__(self, pupil: Policy | None, noise: float, count: int, random: np.random.Generator) -> None:
        self._pupil, self._noise, self._random = pupil, noise, random
        self._disturbance: Array = np.zeros((count, ACTIONS))
        self._observations: list[Floats] = []
        self._actions: list[Floats] = []

    def act(self, seen: Array, wanted: Array, fallen: NDArray[np.bool_]) -> Array:
        """Actions (N, 42) for observations (N, O), of which those of the upright are kept."""
        self._observations.append(seen[~fallen].astype(np.float32))
        self._actions.append(wanted[~fallen].astype(np.float32))
        draws = self._random.standard_normal(wanted.shape)
        self._disturbance = _KEEPS * self._disturbance + np.sqrt(1.0 - _KEEPS**2) * draws
        taken = wanted if self._pupil is None else self._pupil.act(seen).astype(np.float64)
        return taken + self._noise * self._disturbance

    def joined(self) -> tuple[Floats, Floats]:
        """Observations (R, O) and actions (R, 42)."""
        return np.concatenate(self._observations), np.concatenate(self._actions)


def _drawn(
    teacher: Teacher, settings: Recovery, count: int, random: np.random.Generator
) -> tuple[Pushes, Array]:
    """Pushes and the knots (N, KNOTS, C) of their maneuvers: most as in the searches, some from elsewhere."""
    found = teacher.found
    phases, forces, angles = random.random(count), np.zeros(count), np.zeros(count)
    knots = np.zeros((count, maneuver.KNOTS, len(maneuver.COLUMNS)))
    size = round(_TAUGHT * count)
    taught, others = slice(0, size), slice(size + round(UNPUSHED * (count - size)), count)
    of = np.resize(np.arange(len(found)), size)
    phases[taught] = np.array([one.phase for one in found])[of]
    phases[taught] += random.uniform(-1, 1, size) * teacher.around
    angles[taught] = np.array([one.direction for one in found])[of] + random.uniform(-SPREAD, SPREAD, size)
    forces[taught] = random.uniform(_WEAKEST, _HARDER * max(settings.forces), size)
    share = np.clip((forces[taught] - _NONE) / (_WHOLE - _NONE), 0.0, 1.0)
    knots[taught] = np.stack([one.knots for one in found])[of] * share[:, None, None]
    pushed_elsewhere = len(forces[others])
    angles[others] = _elsewhere(np.radians(settings.directions), pushed_elsewhere, random)
    forces[others] = random.uniform(0.0, HARDEST, pushed_elsewhere)
    return Pushes(phases, forces, angles), knots


def _elsewhere(searched: Array, count: int, random: np.random.Generator) -> Array:
    """Angles (N,) that are _APART from those searched, as far as there are any."""
    grid = np.linspace(-np.pi, np.pi, 720, endpoint=False)
    off = np.abs(np.mod(grid[:, None] - searched + np.pi, 2.0 * np.pi) - np.pi).min(axis=1)
    free = grid[off >= min(_APART, off.max())]
    return random.choice(free, count)
