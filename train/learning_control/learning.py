"""Iterative learning control: corrections of the actions by phase, from the errors of the cycles before.

A policy that walks makes much the same error in every cycle. For knees and hips, a correction at a phase
first changes by a share of the mean error one control step later, damped in its higher harmonics (Bristow,
Tharayil and Alleyne 2006, A Survey of Iterative Learning Control, IEEE Control Systems Magazine 26), then by
what the identified response suggests (`response.py`). The other joints keep the balance, and the policy goes
on acting in all of them.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.retarget.humanoid.body import BODY_INDEX
from kinemimic.train.config.learning_control import LearningControl
from kinemimic.train.learning_control.corrections import (
    Corrections,
    Errors,
    joint,
    measured,
    steps_of_cycle,
    weights,
)
from kinemimic.train.learning_control.response import CYCLES, PROBES, identified
from kinemimic.train.reference.reference import Reference
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.task.env import ACTIONS, ImitationBatch

LONG = 8  # cycles without a fall in the end
# Of the corrections, the largest with which nobody falls: 0.7 still removes 91 % of the mean square error.
SHARES = (1.0, 0.7, 0.5)
LEAD = 1  # control steps from a correction to its effect
LIFTED = 0.05  # m above its lowest position, where a foot of the reference swings


class _Trials:
    """Measures corrections of a policy, and remembers those with which it errs least and nobody falls.

    batch: humanoids on a cyclic motion, `cycles` of which each walks; best: corrections and their errors, or
    None.
    """

    def __init__(self, batch: ImitationBatch, policy: Policy, cycles: int) -> None:
        self._batch, self._policy, self._cycles = batch, policy, cycles
        self._weights = weights(batch.reference, steps_of_cycle(batch.reference))
        self._least = np.inf
        self.best: tuple[Array, Errors] | None = None

    def measure(self, table: Array) -> Errors:
        """Errors with corrections (P, 42)."""
        errors = measured(self._batch, self._policy, Corrections(table), self._cycles)
        if not errors.falls.any() and (remaining := errors.remaining(self._weights)) < self._least:
            self.best, self._least = (table, errors), remaining
        return errors


def learn_corrections(
    batch: ImitationBatch,
    probe: ImitationBatch,
    policy: Policy,
    settings: LearningControl,
    proceed: Callable[[int], None],
    seed: int = 0,
) -> Corrections | None:
    """Corrections with which the policy errs least at knees and hips.

    batch: `settings.environments` humanoids on a cyclic motion; probe: `PROBES` on the same;
    proceed: is told the samples of every measurement, and may raise an exception to end it. None if a
    humanoid always falls.
    """
    reference = batch.reference
    rows = steps_of_cycle(reference)
    cost = settings.cycles * rows * batch.world.size
    trials = _Trials(batch, policy, settings.cycles)
    gains, table = _gains(reference, rows, settings), np.zeros((rows, ACTIONS))
    for _ in range(settings.iterations):
        errors = trials.measure(table)
        proceed(cost)
        change = damped(gains * np.roll(errors.joints, -LEAD, axis=0), settings.harmonics)
        table = np.clip(table + change, -settings.largest, settings.largest)
    random = np.random.default_rng(seed)
    for _ in range(settings.rounds):
        if trials.best is None:
            return None
        table, errors = trials.best
        found = identified(probe, policy, table, random)
        proceed(CYCLES * rows * PROBES)
        if found is None:
            continue
        for _ in range(settings.steps):
            table = table + settings.share * found.change(errors)
            table = np.clip(table, -settings.largest, settings.largest)
            errors = trials.measure(table)
            proceed(cost)
    if trials.best is None:
        return None
    for share in SHARES:
        corrections = Corrections(share * trials.best[0])
        falls = measured(batch, policy, corrections, LONG).falls
        proceed(LONG * rows * batch.world.size)
        if not falls.any():
            return corrections
    return None


def _gains(reference: Reference, rows: int, settings: LearningControl) -> Array:
    """(P, 42) shares of the error: knees always, hips less while their foot is on the ground."""
    gains = np.zeros((rows, ACTIONS))
    bodies = reference.bodies(np.arange(rows) / rows)
    for side in SIDES:
        height = bodies.positions[:, BODY_INDEX[f"foot_{side}"], 2]
        swings = height > height.min() + LIFTED
        gains[:, joint(f"shin_{side}")] = settings.knee
        gains[:, joint(f"thigh_{side}")] = np.where(swings, settings.hip_swing, settings.hip_stance)
    return gains


def damped(change: Array, harmonics: float, axis: int = 0) -> Array:
    """Tables whose columns along the phases keep their low harmonics, by a Gaussian of that width."""
    spectrum = np.fft.rfft(change, axis=axis)
    kept = np.exp(-0.5 * np.square(np.arange(spectrum.shape[axis]) / harmonics))
    spectrum *= kept.reshape([-1 if k == axis else 1 for k in range(change.ndim)])
    return np.fft.irfft(spectrum, change.shape[axis], axis=axis)
