"""A policy that looks at nothing: the same correction whatever it observes, by default none."""

from __future__ import annotations

import numpy as np

from kinemimic.train.rollout.policy import Policy
from kinemimic.train.task.env import ACTIONS
from kinemimic.train.task.observation import OBSERVATIONS


def constant(correction: float = 0.0) -> Policy:
    layer = np.zeros((ACTIONS, OBSERVATIONS), np.float32), np.full(ACTIONS, correction, np.float32)
    return Policy((layer,), np.zeros(OBSERVATIONS, np.float32), np.ones(OBSERVATIONS, np.float32))
