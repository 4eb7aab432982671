"""Iterative learning control of many motions at once, as `learning_control/learning.py` does for one.

A correction of knees and hips at a phase changes by a share of the mean error one control step later. Motions
of different durations share a batch, so their mean errors are Fourier series in the phase.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.pipeline.locomotion.phase.fourier import design
from kinemimic.retarget.humanoid.body import BODY_INDEX
from kinemimic.retarget.humanoid.motion import joint_angles
from kinemimic.train.config.env_config import EnvConfig
from kinemimic.train.config.learning_control import LearningControl
from kinemimic.train.learning_control.corrections import (
    COLUMNS,
    FIRST_JOINT,
    JOINTS,
    TURNS,
    Corrections,
    put_back,
)
from kinemimic.train.learning_control.learning import LEAD, LIFTED, damped
from kinemimic.train.reference.reference_library import FollowedReference, ReferenceLibrary
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.sim.engines import open_world
from kinemimic.train.sim.world import CONTROL_RATE
from kinemimic.train.task.env import ACTIONS, ImitationBatch

HUMANOIDS = 4  # on each motion
ROWS = 32  # of a table of corrections
STEPS, LONG = 75, 160  # control steps of a measurement, and of the test with which corrections end
ITERATIONS = 8
SHARES = (1.0, 0.5)  # of the corrections; the largest with which nobody falls is kept
_SETTINGS = LearningControl()
_HARMONICS = 7  # of the mean errors
_SMOOTHING = 1e-3  # weight of their highest harmonic, beside the squares of the errors
_GRID: Array = np.arange(ROWS) / ROWS


@dataclass(frozen=True)
class LibraryCorrections:
    """Corrections of M cyclic motions.

    tables: (M, ROWS, 42) as in `Corrections`, zeros where nothing was learned; learned: (M,) whether
    something was: in a motion that the policy cannot perform, humanoids fall; before, after: (M,) mean square
    errors of knees and hips over the variance of the reference, so that 2 - before is the sum of both R²;
    after is that of the whole corrections, infinite where every measurement had a fall.
    """

    tables: Array
    learned: Mask
    before: Array
    after: Array

    @classmethod
    def concatenated(cls, parts: list[LibraryCorrections]) -> LibraryCorrections:
        """The motions of all parts, in order."""
        return cls(*(np.concatenate([getattr(part, one.name) for part in parts]) for one in fields(cls)))


class ControlTask(NamedTuple):
    """What `library_corrections` needs, in a form that another process can read.

    tables: folder of the library's tables; motions: (M,) of it, all cyclic; env: the policy's task, as it is
    measured.
    """

    tables: Path
    motions: NDArray[np.intp]
    policy: Policy
    env: EnvConfig
    engine: str


def library_corrections(task: ControlTask) -> LibraryCorrections:
    """Corrections with which the policy errs least on each of the motions."""
    library, count = ReferenceLibrary.open(task.tables), len(task.motions)
    followed = FollowedReference(library, np.repeat(task.motions, HUMANOIDS))
    batch = ImitationBatch(open_world(HUMANOIDS * count, task.engine), followed, task.env)
    gains, variances = _gains_and_variances(FollowedReference(library, task.motions))
    lead = LEAD / (CONTROL_RATE * library.durations[task.motions])
    ahead = design((_GRID + lead[:, None]).ravel(), _HARMONICS).reshape(count, ROWS, -1)
    table, best = np.zeros((2, count, ROWS, ACTIONS))
    least, first = np.full(count, np.inf), np.zeros(count)
    for iteration in range(ITERATIONS + 1):
        errors = _measured(batch, task.policy, table, STEPS)
        remaining = (errors.squares / variances).sum(axis=1) / len(SIDES)
        if iteration == 0:
            first = remaining
        better = (errors.falls == 0) & (remaining < least)
        best[better], least[better] = table[better], remaining[better]
        change = gains * (ahead @ errors.coefficients)
        table[:, :, COLUMNS] += damped(change, _SETTINGS.harmonics, axis=1)
        table = np.clip(table, -_SETTINGS.largest, _SETTINGS.largest)
    kept, learned = np.zeros_like(best), np.zeros(count, dtype=np.bool_)
    for share in SHARES:
        falls = _measured(batch, task.policy, share * best, LONG).falls
        stays = ~learned & (falls == 0) & np.isfinite(least)
        kept[stays] = share * best[stays]
        learned |= stays
    batch.world.close()
    return LibraryCorrections(kept, learned, first, least)


class _Errors(NamedTuple):
    """Of M motions: coefficients (M, K, 4) of the mean errors of knees and hips, rad; squares (M, 4), means;
    falls (M,)."""

    coefficients: Array
    squares: Array
    falls: NDArray[np.int64]


def _measured(batch: ImitationBatch, policy: Policy, tables: Array, steps: int) -> _Errors:
    """Errors with corrections (M, ROWS, 42); humanoids start on the reference, at phases k / HUMANOIDS."""
    motions, size, terms = len(tables), batch.world.size, 1 + 2 * _HARMONICS
    corrections = Corrections(np.repeat(tables, HUMANOIDS, axis=0))
    normal, right = np.zeros((motions, terms, terms)), np.zeros((motions, terms, len(COLUMNS)))
    squares, counts = np.zeros((motions, len(COLUMNS))), np.zeros(motions)
    falls = np.zeros(motions, dtype=np.int64)
    everyone = np.arange(size)
    batch.reset(everyone, (everyone % HUMANOIDS) / HUMANOIDS)
    for _ in range(steps):
        batch.step(policy.act(batch.observe()) + batch.reflected(corrections.at(batch.phases)))
        fallen = batch.fallen()
        upright = ~fallen[:, None]
        waves = (design(batch.phases, _HARMONICS) * upright).reshape(motions, HUMANOIDS, terms)
        turns = batch.turns.reshape(size, TURNS)[:, FIRST_JOINT:][:, COLUMNS] * upright
        errors = turns.reshape(motions, HUMANOIDS, -1)
        normal += waves.swapaxes(1, 2) @ waves
        right += waves.swapaxes(1, 2) @ errors
        squares += np.square(errors).sum(axis=1)
        counts += (~fallen).reshape(motions, HUMANOIDS).sum(axis=1)
        falls += fallen.reshape(motions, HUMANOIDS).sum(axis=1)
        put_back(batch, fallen)
    order = np.arange(1, _HARMONICS + 1) / _HARMONICS
    penalty = _SMOOTHING * np.concatenate([[0.0], order**2, order**2])
    normal += counts[:, None, None] * np.diag(penalty)
    normal[counts == 0.0] = np.eye(terms)  # nobody was upright: the mean errors are 0
    coefficients = np.asarray(np.linalg.solve(normal, right), dtype=np.float64)
    return _Errors(coefficients, squares / np.maximum(counts, 1.0)[:, None], falls)


def _gains_and_variances(reference: FollowedReference) -> tuple[Array, Array]:
    """Shares (M, ROWS, 4) of the errors, of hips less while their foot is on the ground, and the variances
    (M, 4) of knees and hips, means of the sides."""
    count = len(reference.motions)
    phases = np.broadcast_to(_GRID, (count, ROWS)).copy()
    bodies, curves = reference.bodies(phases), joint_angles(reference.nodes(phases).reshape(-1, 20, 4))
    gains = np.full((count, ROWS, len(COLUMNS)), _SETTINGS.knee)
    for k, side in enumerate(SIDES):
        height = bodies.positions[:, :, BODY_INDEX[f"foot_{side}"], 2]
        swings = height > height.min(axis=1, keepdims=True) + LIFTED
        gains[:, :, len(SIDES) + k] = np.where(swings, _SETTINGS.hip_swing, _SETTINGS.hip_stance)
    found = [
        np.mean([curves[f"{name}_{side}"].reshape(count, ROWS).var(axis=1) for side in SIDES], axis=0)
        for name in JOINTS
    ]
    return gains, np.repeat(np.stack(found, axis=1), len(SIDES), axis=1)
