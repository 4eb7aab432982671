"""Search for a maneuver by which a humanoid survives a push that its policy does not.

The exploration of a training, one to three degrees at a joint and drawn again in every control step, never
takes a step that the reference does not take: it would have to keep the same turn of tens of degrees for half
a second. The cross-entropy method (R. Rubinstein, "The cross-entropy method for combinatorial and continuous
optimization", Methodology and Computing in Applied Probability 1, 1999) draws whole maneuvers, and finds such
a step within a thousand of them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.env_config import EnvConfig
from kinemimic.train.config.recovery import Recovery
from kinemimic.train.recovery import maneuver
from kinemimic.train.recovery.pushes import SETTLE, Pushes, pushed, walk_to
from kinemimic.train.reference.reference import Reference
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.sim.engines import open_world
from kinemimic.train.sim.world import CONTROL_RATE
from kinemimic.train.task.env import ImitationBatch

STEPS = 3 * CONTROL_RATE  # after which a maneuver has succeeded or not
SPREAD = 0.2  # rad: pushes come from up to this angle off their direction
_FORCE_SPREAD = 0.05  # share by which a force is stronger or weaker, at most
_FIRST, _LEAST = 0.2, 0.05  # standard deviations of the draws, rad
_SMOOTH = 0.6  # correlation of a draw from one knot to the next
_KEPT_MEAN, _KEPT_STD = 0.2, 0.3  # shares of mean and standard deviation that an iteration keeps
_FRESH = 3  # iterations after which the pushes are drawn again
_ENOUGH = 0.85  # share of all pushes survived by all candidates at which the search ends
_EFFORT = 8.0  # control steps of survival that a maneuver of 1 rad² in the mean must be worth


@dataclass(frozen=True)
class SearchTask:
    """A search: phase at which pushes begin, and half the phases to the next one; direction: rad from the
    heading."""

    motion: Motion
    policy: Policy
    config: EnvConfig
    settings: Recovery
    phase: float
    around: float
    direction: float
    seed: np.random.SeedSequence
    engine: str


@dataclass(frozen=True)
class Found:
    """A maneuver, knots (KNOTS, C) in rad; before, after: shares of pushes survived without and with it;
    samples: control steps of the search."""

    phase: float
    direction: float
    before: float
    after: float
    samples: int
    knots: Array


def search(task: SearchTask) -> Found:
    """The maneuver that survives most of the pushes around the task's phase and direction."""
    settings, random = task.settings, np.random.default_rng(task.seed)
    count = settings.candidates
    world = open_world(count * len(settings.forces), task.engine)
    batch = ImitationBatch(world, Reference(task.motion), task.config)
    trials = _Trials(task, batch, random)
    mean: Array = np.zeros((maneuver.KNOTS, len(maneuver.COLUMNS)))
    before = float(trials.run(np.repeat(mean[None], count, axis=0))[1].mean())
    std: Array = np.full_like(mean, _FIRST)
    for iteration in range(1, settings.iterations + 1):
        if before == 1.0:
            break
        if iteration % _FRESH == 0:
            trials.draw()
        candidates = mean + std * _smooth(random.standard_normal((count, *mean.shape)))
        candidates[0] = mean
        scores, upright = trials.run(candidates)
        elite = candidates[np.argsort(-scores, kind="stable")[: settings.elite]]
        mean = _KEPT_MEAN * mean + (1.0 - _KEPT_MEAN) * elite.mean(axis=0)
        std = np.maximum(_KEPT_STD * std + (1.0 - _KEPT_STD) * elite.std(axis=0), _LEAST)
        if upright.mean() > _ENOUGH:
            break
    trials.draw(alike=False)
    after = float(trials.run(np.repeat(mean[None], count, axis=0))[1].mean())
    world.close()
    return Found(task.phase, task.direction, before, after, trials.samples, mean)


class _Trials:
    """Humanoids of all candidates right before pushes of all forces, the same ones for each candidate."""

    def __init__(self, task: SearchTask, batch: ImitationBatch, random: np.random.Generator) -> None:
        self._task, self._batch, self._random = task, batch, random
        self.samples = 0
        self.draw()

    def draw(self, *, alike: bool = True) -> None:
        """Draw other pushes; alike: the same ones for each candidate."""
        task, forces = self._task, np.array(self._task.settings.forces)
        sets = 1 if alike else task.settings.candidates
        phases, spread, factors = self._random.uniform(-1.0, 1.0, (3, sets, len(forces)))
        drawn = (
            task.phase + task.around * phases,
            forces * (1.0 + _FORCE_SPREAD * factors),
            task.direction + SPREAD * spread,
        )
        copies = task.settings.candidates // sets
        self._pushes = Pushes(*(np.tile(values.ravel(), copies) for values in drawn))
        walk_to(self._batch, task.policy, self._pushes.phases)
        self._before = self._batch.snapshot()
        self.samples += SETTLE * len(self._pushes.forces)

    def run(self, candidates: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Scores (C,) of candidates (C, KNOTS, ...), and whether (C, forces) each push is survived."""
        batch, policy = self._batch, self._task.policy
        shape = len(candidates), len(self._task.settings.forces)
        added = maneuver.actions(np.repeat(candidates, shape[1], axis=0))

        def act(step: int, observations: Array) -> Array:
            actions = policy.act(observations).astype(np.float64)
            return actions + batch.reflected(added[step]) if step < len(added) else actions

        batch.restore(self._before)
        scores: Array = np.zeros(shape[0] * shape[1])
        fallen = np.ones(len(scores), dtype=np.bool_)
        for fallen in pushed(batch, self._pushes, STEPS, act):
            # To stay upright counts most, a good posture then points towards it.
            scores += ~fallen * (0.5 + 0.5 * _posture(batch))
            self.samples += len(scores)
        effort = _EFFORT * np.square(candidates).mean(axis=(1, 2))
        return scores.reshape(shape).mean(axis=1) - effort, ~fallen.reshape(shape)


def _posture(batch: ImitationBatch) -> Array:
    """(N,) from 0 to 1: how near a pelvis is to its reference's rotation and height.

    Half of it for each, on scales of 0.5 rad and 0.1 m: a body that falls is far beyond either.
    """
    turned = np.square(batch.turns[:, 0]).sum(axis=-1)
    lower = batch.bodies.positions[:, 0, 2] - batch.target.positions[:, 0, 2]
    found: Array = 0.5 * np.exp(-4.0 * turned) + 0.5 * np.exp(-np.square(lower / 0.1))
    return found


def _smooth(draws: Array) -> Array:
    """Draws (N, KNOTS, C) whose knots are correlated with the knot before."""
    for knot in range(1, draws.shape[1]):
        draws[:, knot] = _SMOOTH * draws[:, knot - 1] + np.sqrt(1.0 - _SMOOTH**2) * draws[:, knot]
    return draws
