"""How the errors of a policy respond to corrections, and the corrections that this suggests.

A leg that carries the humanoid moves the trunk and not itself, and the policy acts against what disturbs its
balance: a hip responds to a correction differently from a knee that swings. So the response is
identified: humanoids walk with small corrections, and a regression on their mean errors gives the
derivatives. A step along these is norm-optimal (Amann, Owens and Rogers 1996, Iterative learning control
using optimal feedback and feedforward actions, International Journal of Control 65).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import hadamard

from kinemimic.pipeline.arrays import Array
from kinemimic.train.learning_control.corrections import COLUMNS, Corrections, Errors, measured, weights
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.task.env import ACTIONS, ImitationBatch

HARMONICS = 6  # of the cycle, in the corrections that are identified
CYCLES = 2  # of a measurement; the errors are those of the last one
_COEFFICIENTS = len(COLUMNS) * (1 + 2 * HARMONICS)
# Humanoids of a measurement. Each probes all coefficients at once, in orthogonal combinations of signs.
PROBES = 1 << _COEFFICIENTS.bit_length()
_MOST_FALLEN = (PROBES - _COEFFICIENTS) // 2  # without them, the regression still has more rows than columns
_PROBE = 0.01  # rad, of each coefficient
_DAMPING = 0.1  # weight of the coefficients' squares, rad⁻², beside the weighted mean square error
# The other joints and the pelvis should stay where they are: weights of their turns, rad⁻¹. Those of knees
# and hips are about 2.
_OTHERS_WEIGHT, _PELVIS_WEIGHT = 0.05, 0.5


@dataclass(frozen=True)
class Response:
    """weights: (45,) of the errors; tables: (K, P, 42) corrections; gain: (K, 45 P) their coefficients for
    weighted errors, which would remove these."""

    weights: Array
    tables: Array
    gain: Array

    def change(self, errors: Errors) -> Array:
        """The change (P, 42) of the corrections after which, were the response linear, least would remain."""
        coefficients = self.gain @ (self.weights * errors.mean).ravel()
        found: Array = np.tensordot(coefficients, self.tables, axes=1)
        return found


def identified(
    batch: ImitationBatch, policy: Policy, table: Array, random: np.random.Generator
) -> Response | None:
    """The response around corrections `table` (P, 42); None if too many humanoids fall.

    batch: `PROBES` humanoids on the motion.
    """
    rows = len(table)
    tables, signs = _tables(rows), _signs(random)
    probes = table + _PROBE * np.tensordot(signs, tables, axes=1)
    errors = measured(batch, policy, Corrections(probes), CYCLES, skipped=CYCLES - 1)
    upright = errors.falls == 0
    if np.count_nonzero(~upright) > _MOST_FALLEN:
        return None
    weight = weights(batch.reference, rows, _OTHERS_WEIGHT)
    weight[:3] = _PELVIS_WEIGHT
    found = (weight * errors.by_humanoid[upright]).reshape(np.count_nonzero(upright), -1)
    columns = np.column_stack([signs[upright], np.ones(len(found))])
    response = np.linalg.lstsq(columns, found)[0][:-1] / _PROBE  # (K, 45 P)
    square = response @ response.T / rows + _DAMPING * np.eye(len(tables))
    return Response(weight, tables, -np.linalg.solve(square, response / rows))


def _signs(random: np.random.Generator) -> Array:
    """(PROBES, K) of ±1, whose columns are orthogonal to each other and to a constant."""
    columns = hadamard(PROBES, dtype=np.float64)[:, 1 : 1 + _COEFFICIENTS]
    signs: Array = columns * random.choice([-1.0, 1.0], size=_COEFFICIENTS)
    return signs


def _tables(rows: int) -> Array:
    """(K, P, 42): corrections of one joint by one harmonic, of mean square 1."""
    phase = 2.0 * np.pi * np.arange(rows) / rows
    waves = [np.ones(rows)]
    for k in range(1, HARMONICS + 1):
        waves += [np.sqrt(2.0) * np.cos(k * phase), np.sqrt(2.0) * np.sin(k * phase)]
    found = np.zeros((_COEFFICIENTS, rows, ACTIONS))
    for index, (column, wave) in enumerate((column, wave) for column in COLUMNS for wave in waves):
        found[index, :, column] = wave
    return found
