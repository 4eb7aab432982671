"""Iterative learning control: corrections of the actions by phase, from the errors of the cycles before.

A policy that walks makes much the same error in every cycle. For knees and hips, a correction at a phase
changes by a share of the mean error one control step later, damped in its higher harmonics (Bristow, Tharayil
and Alleyne 2006, A Survey of Iterative Learning Control, IEEE Control Systems Magazine 26). The other joints
keep the balance, and the policy goes on acting in all of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.retarget.humanoid.body import BODY_INDEX
from kinemimic.retarget.humanoid.motion import Motion, joint_angles
from kinemimic.train.config.learning_control import LearningControl
from kinemimic.train.reference.reference import Reference
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.sim.world import CONTROL_RATE
from kinemimic.train.task.env import ACTION_SCALE, ACTIONS, ImitationBatch

LEAD = 1  # control steps from a correction to its effect
_LIFTED = 0.05  # m above its lowest position, where a foot of the reference swings
_FLEXION = 1  # axis of a joint
_SIDES = ("left", "right")


@dataclass(frozen=True)
class Corrections:
    """table: (P, 42) rotation vectors of the joints, rad, at phases k / P; samples: control steps taken."""

    table: Array
    samples: int

    def at(self, phases: Array) -> Array:
        """Corrections (E, 42) at phases (E,), in units of the action; linear in between."""
        place = np.mod(phases, 1.0) * len(self.table)
        index = np.floor(place).astype(np.int64)
        share = (place - index)[:, None]
        before, after = self.table[index % len(self.table)], self.table[(index + 1) % len(self.table)]
        found: Array = ((1.0 - share) * before + share * after) / ACTION_SCALE
        return found


def joint(name: str) -> int:
    """Column of the flexion of the joint between a body and its parent."""
    return 3 * (BODY_INDEX[name] - 1) + _FLEXION


_JOINTS = {
    name: [joint(f"{body}_{side}") for side in _SIDES] for name, body in (("knee", "shin"), ("hip", "thigh"))
}


def steps_of_cycle(motion: Motion | Reference) -> int:
    """Control steps of a cycle, rounded."""
    return max(2, round(motion.duration * CONTROL_RATE))


def learn_corrections(
    batch: ImitationBatch, policy: Policy, settings: LearningControl, proceed: Callable[[int], bool]
) -> Corrections | None:
    """Corrections with which the policy errs least at knees and hips.

    batch: `settings.environments` humanoids on a cyclic motion; proceed: is told the samples of every
    iteration, and says whether to go on. None if it says no, or if a humanoid fell in every iteration.
    """
    reference = batch.reference
    rows, count = steps_of_cycle(reference), batch.world.size
    gains = _gains(reference, rows, settings)
    variances = _variances(reference, rows)
    table: Array = np.zeros((rows, ACTIONS))
    best, least, samples = None, np.inf, 0
    batch.reset(np.arange(count), np.arange(count) / count)
    for _ in range(settings.iterations + 1):
        errors = _cycles(batch, policy, Corrections(table, 0), settings.cycles * rows)
        samples += errors.samples
        if not proceed(errors.samples):
            return None
        remaining = sum(errors.square[joints].mean() / variances[name] for name, joints in _JOINTS.items())
        if not errors.falls and remaining < least:
            best, least = table, remaining
        change = _damped(gains * errors.mean, settings.harmonics)
        table = np.clip(table + change, -settings.largest, settings.largest)
    return None if best is None else Corrections(best, samples)


@dataclass(frozen=True)
class _Errors:
    """mean: (P, 42) rotation vectors from the pose to the reference, LEAD steps after a phase; square: (42,)
    their mean squares; falls, samples: numbers."""

    mean: Array
    square: Array
    falls: int
    samples: int


def _cycles(batch: ImitationBatch, policy: Policy, corrections: Corrections, steps: int) -> _Errors:
    rows, count = corrections.table.shape[0], batch.world.size
    total, square = np.zeros((rows, ACTIONS)), np.zeros(ACTIONS)
    times = np.zeros(rows)
    falls = 0
    for _ in range(steps):
        corrected_step(batch, policy, corrections)
        fallen = batch.fallen()
        found = batch.turns[~fallen, 1:].reshape(-1, ACTIONS)
        row = np.round(np.mod(batch.phases[~fallen], 1.0) * rows - LEAD).astype(np.int64) % rows
        np.add.at(total, row, found)
        np.add.at(times, row, 1.0)
        square += np.square(found).sum(axis=0)
        falls += int(fallen.sum())
        put_back(batch, fallen)
    mean = total / np.maximum(times, 1.0)[:, None]
    return _Errors(mean, square / max(times.sum(), 1.0), falls, steps * count)


def corrected_step(
    batch: ImitationBatch, policy: Policy, corrections: Corrections, noise: Array | float = 0.0
) -> tuple[Array, Array]:
    """One control step; returns the observations (E, O) before it and the corrected actions (E, 42), which
    are taken with noise."""
    observations = batch.observe()
    actions = policy.act(observations) + batch.reflected(corrections.at(batch.phases))
    batch.step(actions + noise)
    return observations, actions


def put_back(batch: ImitationBatch, fallen: NDArray[np.bool_]) -> None:
    """Put who fell onto the reference."""
    if fallen.any():
        indices = np.flatnonzero(fallen)
        batch.reset(indices, np.mod(batch.phases[indices], 1.0))


def _gains(reference: Reference, rows: int, settings: LearningControl) -> Array:
    """(P, 42) shares of the error: knees always, hips less while their foot is on the ground."""
    gains = np.zeros((rows, ACTIONS))
    bodies = reference.bodies(np.arange(rows) / rows)
    for side in _SIDES:
        height = bodies.positions[:, BODY_INDEX[f"foot_{side}"], 2]
        swings = height > height.min() + _LIFTED
        gains[:, joint(f"shin_{side}")] = settings.knee
        gains[:, joint(f"thigh_{side}")] = np.where(swings, settings.hip_swing, settings.hip_stance)
    return gains


def _variances(reference: Reference, rows: int) -> dict[str, float]:
    """Variances of knee and hip flexion of the reference, rad², means of the sides: those of R²."""
    curves = joint_angles(reference.nodes(np.arange(rows) / rows))
    return {name: float(np.mean([curves[f"{name}_{side}"].var() for side in _SIDES])) for name in _JOINTS}


def _damped(change: Array, harmonics: float) -> Array:
    """A table whose columns keep their low harmonics, by a Gaussian of that width."""
    spectrum = np.fft.rfft(change, axis=0)
    spectrum *= np.exp(-0.5 * np.square(np.arange(len(spectrum)) / harmonics))[:, None]
    return np.fft.irfft(spectrum, len(change), axis=0)
