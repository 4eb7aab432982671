"""Standing still on both feet, which a tracker of walks has never learned."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.train.sim.world import BodyStates
from kinemimic.train.task.balance import balance_turns, off_balance
from kinemimic.train.task.env import ACTION_SCALE, ACTIONS

# Metres that the point to which the body would fall may be off for ankles and hips to hold the body.
HOLDS = (0.14, 0.10)


def holds(bodies: BodyStates) -> bool:
    """Whether the first humanoid can keep its balance without a step."""
    return bool((np.abs(off_balance(bodies)[0]) < HOLDS).all())


def balance_actions(bodies: BodyStates) -> Array:
    """Actions (E, 42) that keep humanoids over their feet."""
    return balance_turns(bodies).reshape(-1, ACTIONS) / ACTION_SCALE
