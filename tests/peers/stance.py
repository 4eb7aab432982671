"""A figure that stands, as an engine is told it."""

from __future__ import annotations

import numpy as np

from kinemimic.retarget.humanoid.body import BODIES
from kinemimic.train.sim.world import SUBSTEPS, TIME_STEP, BodyStates, Poses

MASSES = np.array([body.mass for body in BODIES])
STEP = SUBSTEPS * TIME_STEP
HOLD = (np.tile([0.0, 0.0, 0.0, 1.0], (1, SUBSTEPS, 14, 1)), np.zeros((1, SUBSTEPS, 14, 3)))


def upright(height: float) -> Poses:
    still = np.zeros((1, 3))
    identity = np.array([[0.0, 0.0, 0.0, 1.0]])
    return Poses(
        np.array([[0.0, 0.0, height]]), identity, still, still, np.tile(identity[:, None], (1, 14, 1)),
        np.zeros((1, 14, 3)),
    )  # fmt: skip


def momentum(state: BodyStates) -> np.ndarray:
    return MASSES @ state.linear[0]
