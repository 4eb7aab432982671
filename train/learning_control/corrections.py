"""Corrections of a policy's actions by phase, and the errors that remain with them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.retarget.humanoid.body import BODIES, BODY_INDEX
from kinemimic.retarget.humanoid.motion import Motion, joint_angles
from kinemimic.train.reference.reference import Reference
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.sim.world import CONTROL_RATE
from kinemimic.train.task.env import ACTION_SCALE, ACTIONS, ImitationBatch

TURNS = 3 * len(BODIES)  # of the pelvis, then of the joints, as in an action
FIRST_JOINT = TURNS - ACTIONS  # after the turn of the pelvis
_FLEXION = 1  # axis of a joint


def joint(name: str) -> int:
    """Column of the flexion of the joint between a body and its parent, in an action."""
    return 3 * (BODY_INDEX[name] - 1) + _FLEXION


JOINTS = {
    name: [joint(f"{body}_{side}") for side in SIDES] for name, body in (("knee", "shin"), ("hip", "thigh"))
}
COLUMNS = JOINTS["knee"] + JOINTS["hip"]


def steps_of_cycle(motion: Motion | Reference) -> int:
    """Control steps of a cycle, rounded."""
    return max(2, round(motion.duration * CONTROL_RATE))


@dataclass(frozen=True)
class Corrections:
    """table: (P, 42) rotation vectors of the joints, rad, at phases k / P, or (E, P, 42), one of each
    environment."""

    table: Array

    def at(self, phases: Array) -> Array:
        """Corrections (E, 42) at phases (E,), in units of the action; linear in between."""
        rows = self.table.shape[-2]
        place = np.mod(phases, 1.0) * rows
        index = np.floor(place).astype(np.int64)
        share = (place - index)[:, None]
        tables = self.table if self.table.ndim == 3 else self.table[None]
        owner = np.arange(len(phases)) % len(tables)
        before, after = tables[owner, index % rows], tables[owner, (index + 1) % rows]
        found: Array = ((1.0 - share) * before + share * after) / ACTION_SCALE
        return found


@dataclass(frozen=True)
class Errors:
    """Of E humanoids by the phase of P that they had after a control step.

    sums: (E, P, 45) of the rotation vectors from pose to reference, rad: pelvis, then joints; counts: (E, P)
    of control steps; squares: (45,) means of their squares; falls: (E,).
    """

    sums: Array
    counts: Array
    squares: Array
    falls: NDArray[np.int64]

    @property
    def by_humanoid(self) -> Array:
        """Mean errors (E, P, 45), 0 where a humanoid was never."""
        mean: Array = self.sums / np.maximum(self.counts, 1.0)[..., None]
        return mean

    @cached_property
    def mean(self) -> Array:
        """Mean errors (P, 45) of all humanoids."""
        mean: Array = self.sums.sum(axis=0) / np.maximum(self.counts.sum(axis=0), 1.0)[:, None]
        return mean

    @property
    def joints(self) -> Array:
        """Mean errors (P, 42) of the joints."""
        return self.mean[:, FIRST_JOINT:]

    def remaining(self, weights: Array) -> float:
        """Mean square of the errors of the joints, with weights (45,)."""
        return float((np.square(weights) * self.squares)[FIRST_JOINT:].sum())


def measured(
    batch: ImitationBatch, policy: Policy, corrections: Corrections, cycles: int, skipped: int = 0
) -> Errors:
    """Errors over `cycles` cycles, which start on the reference at phases k / E, without those `skipped`."""
    rows, count = corrections.table.shape[-2], batch.world.size
    sums, counts = np.zeros((count, rows, TURNS)), np.zeros((count, rows))
    squares, falls = np.zeros(TURNS), np.zeros(count, dtype=np.int64)
    humanoids = np.arange(count)
    batch.reset(humanoids, humanoids / count)
    for step in range(cycles * rows):
        corrected_step(batch, policy, corrections)
        fallen = batch.fallen()
        falls += fallen
        if step >= skipped * rows:
            upright = humanoids[~fallen]
            found = batch.turns[upright].reshape(len(upright), TURNS)
            row = np.round(np.mod(batch.phases[upright], 1.0) * rows).astype(np.int64) % rows
            sums[upright, row] += found
            counts[upright, row] += 1.0
            squares += np.square(found).sum(axis=0)
        put_back(batch, fallen)
    return Errors(sums, counts, squares / max(counts.sum(), 1.0), falls)


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
    """Put the humanoids that fell onto the reference."""
    if fallen.any():
        indices = np.flatnonzero(fallen)
        batch.reset(indices, np.mod(batch.phases[indices], 1.0))


def weights(reference: Reference, rows: int, others: float = 0.0) -> Array:
    """Weights (45,) of errors: knee and hip flexion by the deviations of their reference, so that the mean
    squares of weighted errors add up to 2 - R² - R² (means of the sides); `others` for all other turns."""
    found = np.full(TURNS, others)
    curves = joint_angles(reference.nodes(np.arange(rows) / rows))
    for name, columns in JOINTS.items():
        variance = np.mean([curves[f"{name}_{side}"].var() for side in SIDES])
        found[np.add(columns, FIRST_JOINT)] = 1.0 / np.sqrt(len(SIDES) * variance)
    return found
